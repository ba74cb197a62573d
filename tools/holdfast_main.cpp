#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "common/program.h"

namespace {

struct Command {
  const char* name;
  const char* does;
};

constexpr Command kCommands[] = {
    {"check", "which attacks can be corrected, before any run"},
    {"run", "run a scenario live and print its results"},
    {"campaign", "run a scenario many times in process"},
    {"reproduce", "run a paper's figures and tables and compare"},
    {"review", "errors, counters, labels and comparison of logs"},
    {"plant", "simulate the plant of a scenario"},
    {"attacker", "the man in the middle between two buses"},
    {"control", "change the rules of a running attacker"},
    {"can-driver", "frames of a bus to measurement sets; what is on a bus"},
    {"modbus", "ask the sensors of a serial line, tell it on a bus"},
    {"dbc", "what a DBC file says; frames by it"},
    {"estimator", "run an estimator live or on a log"},
    {"smoother", "look back over a whole log"},
};

void list_commands(std::ostream& stream) {
  stream << "usage: holdfast COMMAND [options]     (holdfast COMMAND --help tells more)\n\n";
  for (const Command& command : kCommands) {
    stream << "  " << command.name << std::string(12 - std::string(command.name).size(), ' ')
           << command.does << "\n";
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "";
  if (name.empty() || name == "--help" || name == "-h" || name == "help") {
    list_commands(std::cout);
    return 0;
  }
  if (name == "--version") {
    std::cout << holdfast::version_line("holdfast") << "\n";
    return 0;
  }
  for (const Command& command : kCommands) {
    if (name != command.name) continue;
    const std::string program =
        (std::filesystem::read_symlink("/proc/self/exe").parent_path() / ("holdfast-" + name))
            .string();
    std::vector<char*> arguments(argv + 1, argv + argc);
    arguments[0] = const_cast<char*>(program.c_str());
    arguments.push_back(nullptr);
    execv(program.c_str(), arguments.data());
    std::cerr << "holdfast: cannot run " << program << "\n";
    return 1;
  }
  std::cerr << "holdfast: there is no command '" << name << "'\n\n";
  list_commands(std::cerr);
  return 2;
}
