#!/usr/bin/python3
"""Says which file includes or calls what its place in the tree forbids (the rules stand in RULES and LAYERS).

usage: check_layers.py [ROOT]      exit status 1 when something is wrong, one line for each
       check_layers.py --self-test plants one violation of every rule and wants to hear of it
"""
import os
import re
import sys
import tempfile

FOLDERS = ("lcmtypes", "common", "plant", "attacker", "estimators", "drivers", "tools", "tests", "examples")
SUFFIXES = (".h", ".hpp", ".cpp", ".c")

# Folder -> folders that its pure files may include. Mains wire, and may include everything but tests.
LAYERS = {
    "lcmtypes": set(),
    "common": {"common"},
    "plant": {"plant", "common"},
    "attacker": {"attacker", "common"},
    "estimators": {"estimators", "common"},
    "drivers": {"drivers", "common"},
    "tools": {"tools", "plant", "attacker", "estimators", "drivers", "common"},
}
# The attacker sees frames and their layout, and nothing else of the drivers.
EXCEPTIONS = {"attacker": ("drivers/can/", "drivers/sensors/")}


def is_main(path):
    return path.endswith("_main.cpp")


def is_message_file(path):
    return re.search(r"_messages\.(h|cpp)$", path) is not None


def may_know_lcm(path):
    return path.startswith(("common/", "tools/", "tests/", "examples/")) or is_message_file(path) or is_main(path)


def may_use_sockets(path):
    # common/lcm_socket_filter guards the socket that LCM opened.
    return path.startswith(("drivers/", "tests/", "examples/", "common/lcm_socket_filter.")) or is_main(path)


def may_read_clock(path):
    # tests/bench and tests/ time what they test.
    return path.startswith(("common/clock.", "tests/", "examples/"))


def may_know_truth(path):
    return path.startswith(("plant/", "tools/", "tests/", "examples/"))


def nobody(_path):
    return False


# (name, pattern over code without comments, who may, what to do instead, a line that breaks it)
RULES = [
    ("LCM", r'#include\s*<lcm/', may_know_lcm,
     "only common/, *_messages.* and mains know LCM", "#include <lcm/lcm-cpp.hpp>"),
    ("message type", r'#include\s*<holdfast/\w+(_t\.hpp|layouts\.h)>', may_know_lcm,
     "only common/, *_messages.* and mains know message types", "#include <holdfast/packet_t.hpp>"),
    ("socket", r'#include\s*<(sys/socket\.h|netinet/|arpa/inet\.h|linux/can|boost/asio)', may_use_sockets,
     "sockets live in drivers/ and mains", "#include <sys/socket.h>"),
    ("clock", r'\b(steady_clock|system_clock|high_resolution_clock|clock_gettime|gettimeofday)\b|\bstd::time\s*\(|'
              r'(?<![\w.>:])time\s*\(\s*(NULL|nullptr|0|&)', may_read_clock,
     "only common/clock.cpp reads a clock", "auto now = std::chrono::steady_clock::now();"),
    ("randomness", r'\brandom_device\b|(?<![\w.>:])s?rand\s*\(|\bstd::s?rand\b|\bstd::\w+_distribution\b|'
                   r'(Eigen::\w+|Matrix\w*|Vector\w*|Array\w*)(<[^;]*>)?::Random\s*\(', nobody,
     "randomness comes from common/random_stream.h", "std::random_device device;"),
    # Its numbers are the standard's, so a test may use it; a scenario's seed has no part in it.
    ("generator", r'\b(mt19937|minstd_rand|default_random_engine)', lambda path: path.startswith("tests/"),
     "randomness comes from common/random_stream.h", "std::mt19937 generator(1);"),
    ("truth", r'#include\s*<holdfast/truth_t\.hpp>', may_know_truth,
     "no estimator, driver or attacker knows the truth", "#include <holdfast/truth_t.hpp>"),
    ("sleep", r'\b(sleep_for|sleep_until|usleep|nanosleep)\s*\(', nobody,
     "wait for a condition or a Pacer, with a deadline", "std::this_thread::sleep_for(delay);"),
]


def code_only(text):
    """The text with comments blanked and string contents kept; line numbers stay."""
    def blank(match):
        return match.group(0) if match.group(0)[0] in "\"'" else re.sub(r"[^\n]", " ", match.group(0))
    return re.sub(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|//[^\n]*|/\*.*?\*/', blank, text, flags=re.S)


def includes(code):
    for match in re.finditer(r'^\s*#\s*include\s*"([^"]+)"', code, flags=re.M):
        yield code.count("\n", 0, match.start(1)) + 1, match.group(1)


def check_includes(path, code):
    folder = path.split("/")[0]
    for line, name in includes(code):
        target = name.split("/")[0]
        if target not in FOLDERS:
            yield f'{path}:{line}: "{name}": write includes from the repository root'
        elif target == "tests" and folder != "tests":
            yield f'{path}:{line}: "{name}": nothing includes tests'
        elif folder in LAYERS and not is_main(path) and target not in LAYERS[folder]:
            if not name.startswith(EXCEPTIONS.get(folder, "\0")):
                yield f'{path}:{line}: "{name}": {folder}/ does not include {target}/'


def check_file(path, text):
    code = code_only(text)
    yield from check_includes(path, code)
    for name, pattern, may, advice, _ in RULES:
        if may(path):
            continue
        for match in re.finditer(pattern, code):
            line = code.count("\n", 0, match.start()) + 1
            yield f"{path}:{line}: {name}: '{match.group(0).strip()}': {advice}"


def sources(root):
    for folder in FOLDERS:
        for place, folders, files in os.walk(os.path.join(root, folder)):
            folders[:] = sorted(name for name in folders if name != "build")
            for name in sorted(files):
                if name.endswith(SUFFIXES):
                    yield os.path.relpath(os.path.join(place, name), root).replace(os.sep, "/")


def check_tree(root):
    problems = []
    for path in sources(root):
        with open(os.path.join(root, path), encoding="utf-8") as stream:
            problems.extend(check_file(path, stream.read()))
    return problems


def self_test():
    planted = [("estimators/rule.cpp", rule[4], rule[0]) for rule in RULES]
    planted += [
        ("plant/x.cpp", '#include "estimators/estimator.h"', "plant/ does not include estimators/"),
        ("estimators/x.h", '#include "drivers/can/can_frame.h"', "estimators/ does not include drivers/"),
        ("attacker/x.cpp", '#include "drivers/measurement_assembler.h"', "attacker/ does not include drivers/"),
        ("common/x.cpp", '#include "tools/launcher.h"', "common/ does not include tools/"),
        ("tools/x.cpp", '#include "tests/support/catch.h"', "nothing includes tests"),
        ("plant/plant_main.cpp", '#include "tests/support/catch.h"', "nothing includes tests"),
        ("plant/y.cpp", '#include "plant.h"', "from the repository root"),
        ("attacker/y.cpp", "int x = rand();", "randomness"),
        ("plant/z.cpp", "auto x = Eigen::VectorXd::Random(3);", "randomness"),
        ("drivers/z.cpp", "seed(time(nullptr));", "clock"),
    ]
    allowed = [
        ("attacker/x.cpp", '#include "drivers/can/can_frame.h"'),
        ("estimators/estimator_main.cpp", '#include "drivers/event_loop.h"'),
        ("estimators/estimate_messages.cpp", "#include <holdfast/estimate_t.hpp>"),
        ("plant/x.cpp", "// std::random_device is never used\n/* rand() */"),
        ("plant/x.cpp", "double compute_time(int); double a = compute_time(0) + record.time(0);"),
        ("drivers/can/x.cpp", "#include <boost/asio.hpp>"),
        ("common/clock.cpp", "clock_gettime(clock, &now);"),
    ]
    failures = []
    for path, line, expected in planted:
        with tempfile.TemporaryDirectory() as root:
            os.makedirs(os.path.join(root, os.path.dirname(path)))
            with open(os.path.join(root, path), "w", encoding="utf-8") as stream:
                stream.write("int first_line;\n" + line + "\n")
            told = check_tree(root)
            if not any(f"{path}:2: " in problem and expected in problem for problem in told):
                failures.append(f"not found in {path}: {line} (told: {told})")
    for path, line in allowed:
        told = list(check_file(path, line))
        if told:
            failures.append(f"wrongly refused: {told}")
    return failures


def main():
    if sys.argv[1:] == ["--self-test"]:
        problems, what = self_test(), "self-test"
    else:
        root = sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
        if not list(sources(root)):
            sys.exit(f"check_layers: no sources below {root}")
        problems, what = check_tree(root), "layers"
    print("\n".join(problems) if problems else f"{what}: fine")
    sys.exit(1 if problems else 0)


main()
