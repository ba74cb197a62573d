#!/usr/bin/env python3
"""check_includes.py BUILD: does each source name the headers of what it uses?

Precompiled headers hide that a source has forgotten one, and then it compiles here and nowhere else.
So the preprocessor says which headers each source reaches without them, and the source's text, which
of those that are precompiled (or come with them) it needs. Sources are those of
BUILD/compile_commands.json. With --self-test: is a forgotten header found, and one that is there not?
"""
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

FOLDERS = ["common", "drivers", "plant", "attacker", "estimators", "tools"]

# What a text has -> (the header to include, the file that then is reached).
NEEDS = [(re.compile(pattern), header, re.compile(reached + "$")) for pattern, header, reached in [
    (r"\bEigen::", "<Eigen/Core>", r"/Eigen/Core"),
    (r"\.llt\(|\bLLT<", "<Eigen/Cholesky>", r"/Eigen/src/Cholesky/LLT\.h"),
    (r"\bYAML::", "<yaml-cpp/yaml.h>", r"/yaml-cpp/(yaml|node/node)\.h"),
    (r"\bstd::vector\b", "<vector>", r"/bits/stl_vector\.h"),
    (r"\bstd::(string|to_string)\b", "<string>", r"/bits/basic_string\.h"),
    (r"\bstd::string_view\b", "<string_view>", r"/string_view"),
    (r"\bstd::(multi)?map\b", "<map>", r"/bits/stl_map\.h"),
    (r"\bstd::set\b", "<set>", r"/bits/stl_set\.h"),
    (r"\bstd::unordered_map\b", "<unordered_map>", r"/unordered_map"),
    (r"\bstd::list\b", "<list>", r"/bits/stl_list\.h"),
    (r"\bstd::deque\b", "<deque>", r"/bits/stl_deque\.h"),
    (r"\bstd::array\b", "<array>", r"/array"),
    (r"\bstd::span\b", "<span>", r"/span"),
    (r"\bstd::optional\b", "<optional>", r"/optional"),
    (r"\bstd::function\b", "<functional>", r"/bits/std_function\.h"),
    (r"\bstd::(unique_ptr|make_unique)\b", "<memory>", r"/bits/unique_ptr\.h"),
    (r"\bstd::(shared_ptr|make_shared)\b", "<memory>", r"/bits/shared_ptr\.h"),
    (r"\bstd::(stable_)?(sort|find_if|any_of|all_of|none_of|count_if|remove_if|clamp|nth_element|transform)\b",
     "<algorithm>", r"/bits/stl_algo\.h"),
    (r"\bstd::ranges::(sort|find|find_if|any_of|all_of|none_of|count|count_if|fill|copy|max|min)\b",
     "<algorithm>", r"/bits/ranges_algo\.h"),
    (r"\bstd::(min|max|copy|copy_n|fill|fill_n|equal)\(", "<algorithm>", r"/bits/stl_algobase\.h"),
    (r"\bstd::(sqrt|exp|log|log1p|sin|cos|atan2|pow|floor|ceil|hypot|isnan|isfinite)\(", "<cmath>", r"/cmath"),
    (r"\bstd::(memcpy|memset|memcmp|strlen)\(", "<cstring>", r"/cstring"),
    (r"\bstd::u?int(8|16|32|64)_t\b", "<cstdint>", r"/cstdint"),
    (r"\bstd::numeric_limits\b", "<limits>", r"/limits"),
    (r"\bstd::[io]?stringstream\b", "<sstream>", r"/sstream"),
    (r"\bstd::[io]?fstream\b", "<fstream>", r"/fstream"),
    (r"\bstd::(cout|cerr|clog)\b", "<iostream>", r"/iostream"),
    (r"\bstd::complex\b", "<complex>", r"/complex"),
]]


def code_of(text):
    """The text without comments and strings."""
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(\\.|[^"\\\n])*"', " ", text, flags=re.DOTALL)


def reached_headers(entry):
    """What a source includes, directly or not, without what is precompiled."""
    arguments, command = [], iter(shlex.split(entry["command"]))
    for argument in command:
        if argument in ("-o", "-c", "-MF", "-MT", "-include"):
            value = next(command)
            if argument == "-include" and "cmake_pch" not in value:
                arguments += [argument, value]
        elif argument not in ("-MD", "-Winvalid-pch", "ccache"):
            arguments.append(argument)
    if os.path.basename(arguments[0]) == "ccache":
        del arguments[0]
    arguments = [argument for argument in arguments if "/Unity/" not in argument]
    listing = subprocess.run(arguments + ["-w", "-M", entry["file"]], cwd=entry["directory"], check=True,
                             capture_output=True, text=True).stdout
    return listing.replace("\\\n", " ").split()[1:]


def problems_of(entry):
    code = code_of(pathlib.Path(entry["file"]).read_text(encoding="utf-8"))
    reached = reached_headers(entry)
    return [f"{entry['file']}: uses {use.search(code).group()} without {header}"
            for use, header, path in NEEDS if use.search(code) and not any(path.search(file) for file in reached)]


def entries_of(build):
    source = next(line.split("=", 1)[1].strip() for line in (build / "CMakeCache.txt").open(encoding="utf-8")
                  if line.startswith("CMAKE_HOME_DIRECTORY"))
    entries = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))
    wanted = tuple(f"{source}/{folder}/" for folder in FOLDERS)
    return [single for entry in entries for single in singles_of(entry) if single["file"].startswith(wanted)]


def singles_of(entry):
    """The entry, or one for each of the sources that a unity build has joined in it."""
    if "/Unity/" not in entry["file"]:
        return [entry]
    text = pathlib.Path(entry["directory"], entry["file"]).read_text(encoding="utf-8")
    return [{**entry, "file": file} for file in re.findall(r'^#include "(/[^"]+)"$', text, re.MULTILINE)]


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        for text, num_problems in [
                ("std::vector<int> a;\nstd::string b;", 2), ("#include <vector>\nstd::vector<int> a;", 0),
                ("// std::vector<int> a;\nconst char* b = \"std::map\";", 0),
                ('#include "own.h"\nstd::vector<int> a;', 0), ("double a = std::sqrt(2.0);", 1)]:
            source = pathlib.Path(folder, "source.cpp")
            source.write_text(text + "\n", encoding="utf-8")
            source.with_name("own.h").write_text("#include <vector>\n", encoding="utf-8")
            found = problems_of({"file": str(source), "directory": folder, "command":
                                 f"c++ -std=c++20 -Winvalid-pch -include cmake_pch.hxx -o source.o -c {source}"})
            assert len(found) == num_problems, (text, found)
        joined = pathlib.Path(folder, "Unity", "unity_0_cxx.cxx")
        joined.parent.mkdir()
        joined.write_text(f'/* joined */\n\n#include "{source}"\n', encoding="utf-8")
        singles = singles_of({"file": str(joined), "directory": folder, "command":
                              f"c++ -std=c++20 -o joined.o -c {joined}"})
        assert [single["file"] for single in singles] == [str(source)], singles
        assert len(problems_of(singles[0])) == 1


def main():
    if sys.argv[1:] == ["--self-test"]:
        self_test()
        return 0
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    entries = entries_of(pathlib.Path(sys.argv[1]))
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        problems = sorted({line for found in pool.map(problems_of, entries) for line in found})
    print("\n".join(problems + [f"{len(entries)} sources, {len(problems)} headers not named"]))
    return 1 if problems or not entries else 0


if __name__ == "__main__":
    sys.exit(main())
