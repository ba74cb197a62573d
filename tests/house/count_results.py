#!/usr/bin/python3
"""Counts the results of CTest runs: the last line is "N passed, N failed" (and skipped ones, if any).

usage: count_results.py [--must-run FILE] RESULTS.xml...
--must-run: a file with a test's name a line; none listed, or one of them not run, is a failure.
"""
import sys
import xml.etree.ElementTree


def read(paths):
    """{test name: [outcome]} with outcome passed, failed or skipped."""
    outcomes = {}
    for path in paths:
        for case in xml.etree.ElementTree.parse(path).iter("testcase"):
            if case.find("failure") is not None or case.get("status") == "fail":
                outcome = "failed"
            elif case.get("status") == "run" and case.find("skipped") is None:
                outcome = "passed"
            else:
                outcome = "skipped"
            outcomes.setdefault(case.get("name"), []).append(outcome)
    return outcomes


def main():
    arguments = sys.argv[1:]
    must_run = None
    if arguments[:1] == ["--must-run"]:
        with open(arguments[1], encoding="utf-8") as stream:
            must_run = stream.read().splitlines()
        arguments = arguments[2:]
    outcomes = read(arguments)
    problems = []
    if must_run is not None:
        if not must_run:
            problems.append("no test is labelled as one that needs kernel CAN")
        problems += [f"did not run: {name}" for name in must_run if "passed" not in outcomes.get(name, [])
                     and "failed" not in outcomes.get(name, [])]
    count = {kind: sum(list_.count(kind) for list_ in outcomes.values()) for kind in ("passed", "failed", "skipped")}
    problems += [f"failed: {name}" for name, list_ in outcomes.items() if "failed" in list_]
    if problems:
        print("\n".join(problems))
    skipped = f", {count['skipped']} skipped" if count["skipped"] else ""
    print(f"{count['passed']} passed, {count['failed']} failed{skipped}")
    sys.exit(1 if problems or not count["passed"] else 0)


main()
