#!/usr/bin/python3
"""Says which sources are not formatted, and which files, functions and mains are too long.

usage: check_style.py [ROOT]       exit status 1 when something is wrong, one line for each
       check_style.py --self-test  plants one violation of every rule and wants to hear of it
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile

FOLDERS = ("common", "plant", "attacker", "estimators", "drivers", "tools", "tests", "examples")
FILE_LINES_MAX = 450
FUNCTION_LINES_MAX = 70
MAIN_LINES_MAX = 110


def sources(root):
    for folder in FOLDERS:
        for place, folders, files in os.walk(os.path.join(root, folder)):
            folders[:] = sorted(name for name in folders if name != "build")
            for name in sorted(files):
                if name.endswith((".h", ".hpp", ".cpp", ".c")):
                    yield os.path.relpath(os.path.join(place, name), root).replace(os.sep, "/")


def functions(lines):
    """(line, name, length) of each function: clang-format leaves its closing brace where its head began."""
    head = re.compile(r"^( *)(?!namespace\b|class\b|struct\b|enum\b|union\b|extern\b|if\b|for\b|while\b|switch\b|"
                      r"else\b|do\b|try\b|return\b|\}|#|//)[\w~:<>,*&\[\] ]*?([\w~:]+)\(")
    start = None
    for number, line in enumerate(lines, 1):
        if start is None:
            match = head.match(line)
            if match:
                start, indent, name = number, match.group(1), match.group(2)
        if start is None:
            continue
        if line.startswith(indent + "}") and number > start:
            yield start, name, number - start + 1
            start = None
        elif re.search(r"[;}]\s*$", line) and not any("{" in earlier for earlier in lines[start - 1:number]):
            start = None  # a declaration
        elif number == start and line.rstrip().endswith("}"):
            start = None  # all on one line
        elif number > start and re.match(r"^\S", line) and not line.startswith((indent + "}", "#")) and indent:
            start = None


def check_lengths(path, text):
    lines = text.splitlines()
    if path.endswith("_main.cpp") and len(lines) > MAIN_LINES_MAX:
        yield f"{path}:1: a main of {len(lines)} lines; at most {MAIN_LINES_MAX}"
    elif len(lines) > FILE_LINES_MAX:
        yield f"{path}:1: {len(lines)} lines; at most {FILE_LINES_MAX}"
    for number, name, length in functions(lines):
        if length > FUNCTION_LINES_MAX:
            yield f"{path}:{number}: {name} has {length} lines; at most {FUNCTION_LINES_MAX}"


def check_format(root, paths):
    formatter = shutil.which("clang-format")
    if formatter is None:
        return ["clang-format is not installed: run scripts/setup --test"]
    result = subprocess.run([formatter, "--dry-run", "-Werror", "--style=file", *paths], cwd=root,
                            stderr=subprocess.PIPE, text=True, check=False)
    told = dict.fromkeys(re.findall(r"^(\S+?):(\d+):\d+: error", result.stderr, flags=re.M))
    first = {}
    for path, line in told:
        first.setdefault(path, line)
    problems = [f"{path}:{line}: not formatted: run clang-format -i" for path, line in first.items()]
    if result.returncode != 0 and not problems:
        problems.append(f"clang-format failed: {result.stderr.strip()}")
    return problems


def check_tree(root):
    paths = list(sources(root))
    if not paths:
        return [f"no sources below {root}"]
    problems = check_format(root, paths)
    for path in paths:
        with open(os.path.join(root, path), encoding="utf-8") as stream:
            problems.extend(check_lengths(path, stream.read()))
    return problems


def self_test():
    body = "  call();\n"
    planted = {
        "common/long_file.cpp": ("int a;\n" * (FILE_LINES_MAX + 1), "lines; at most"),
        "common/long_function.cpp": ("void f(int a,\n       int b) {\n" + body * 70 + "}\n", "f has 73 lines"),
        "common/long_member.h": ("class A {\n  int g() const {\n" + ("  " + body) * 70 + "  }\n};\n", "g has 72 lines"),
        "common/long_test.cpp": ('TEST_CASE("a") {\n' + body * 70 + "}\n", "TEST_CASE has 72 lines"),
        "plant/plant_main.cpp": ("int a;\n" * (MAIN_LINES_MAX + 1), "a main of"),
        "common/unformatted.cpp": ("int   a ;\n", "not formatted"),
    }
    fine = ("void declared(int a);\nint h() { return 1; }\nnamespace n {\n" + "void k() {\n" + body * 60 + "}\n" * 1 +
            "void l() {\n" + body * 60 + "}\n}  // namespace n\n")
    failures = [f"wrongly refused: {problem}" for problem in check_lengths("common/fine.cpp", fine)]
    for path, (text, expected) in planted.items():
        with tempfile.TemporaryDirectory() as root:
            os.makedirs(os.path.join(root, os.path.dirname(path)))
            with open(os.path.join(root, path), "w", encoding="utf-8") as stream:
                stream.write(text)
            told = check_tree(root)
            if not any(problem.startswith(path) and expected in problem for problem in told):
                failures.append(f"not found in {path}: {expected} (told: {told})")
    return failures


def main():
    if sys.argv[1:] == ["--self-test"]:
        problems, what = self_test(), "self-test"
    else:
        root = sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
        problems, what = check_tree(root), "style"
    print("\n".join(problems) if problems else f"{what}: fine")
    sys.exit(1 if problems else 0)


main()
