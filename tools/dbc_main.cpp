#include <filesystem>
#include <fstream>
#include <iostream>
#include <ostream>
#include <string>
#include <vector>

#include "common/errors.h"
#include "tools/dbc_tool.h"
#include "tools/printable_text.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

struct DbcOptions {
  std::string file, log, out, message;
  std::vector<std::string> signals;
  bool is_strict = false;
};

// What was left out is said in any case; with --strict it is a failure.
Dbc load(const DbcOptions& options) {
  Dbc dbc = load_dbc(options.file);
  std::cerr << problems_text(dbc, options.file);
  if (options.is_strict && !dbc.problems.empty())
    throw UsageError(options.file + ": " + std::to_string(dbc.problems.size()) + " problems");
  if (dbc.messages.empty())
    throw UsageError(options.file + ": not one message was read; is this a DBC file?");
  return dbc;
}

// A disk that is full must not pass for success.
void finish_output(std::ostream& out) {
  if (!out.flush()) throw JobError("the output cannot be written");
}

int decode(const DbcOptions& options) {
  const Dbc dbc = load(options);
  std::ifstream log(options.log);
  if (!log) throw UsageError(options.log + ": cannot be read");
  std::ofstream file;
  if (!options.out.empty()) {
    if (std::filesystem::exists(options.out))
      throw UsageError(options.out + ": exists already; remove it or name another file");
    file.open(options.out);
    if (!file) throw JobError(options.out + ": cannot be made");
  }
  std::ostream& csv = options.out.empty() ? std::cout : file;
  const DecodeCounts counts = decode_to_csv(dbc, log, csv);
  finish_output(csv);
  std::cerr << "frames " << counts.frames << "  decoded " << counts.decoded << "  not in the DBC "
            << counts.unknown << "  of another form " << counts.wrong_format << "  broken lines "
            << counts.broken_lines << '\n';
  if (counts.frames == 0)
    throw UsageError(options.log + ": holds no frame in the format of candump -L");
  return 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{"Shows what a DBC file says, and reads and writes frames by it."};
  app.footer(
      "Examples:\n  holdfast-dbc list vendor.dbc\n"
      "  holdfast-dbc decode vendor.dbc candump.log --out signals.csv\n"
      "  holdfast-dbc encode vendor.dbc Level HIGH=1 STEP=3");
  app.require_subcommand(1);
  holdfast::DbcOptions options;
  CLI::App* list = app.add_subcommand("list", "Messages, signals and names of values");
  CLI::App* decode = app.add_subcommand("decode", "A recording of candump -L as CSV");
  CLI::App* encode = app.add_subcommand("encode", "A frame, as cansend takes it");
  for (CLI::App* command : {list, decode, encode}) {
    command->add_option("dbc", options.file, "DBC file")->required();
    command->add_flag("--strict", options.is_strict, "Status 2 when a line was not understood");
  }
  decode->add_option("log", options.log, "Recording, as candump -L writes it")->required();
  decode->add_option("--out", options.out, "CSV file [standard output]");
  encode->add_option("message", options.message, "Name of a message")->required();
  encode->add_option("signals", options.signals, "NAME=VALUE, a number or a name of its values");
  return holdfast::run_command_line(app, "holdfast-dbc", argc, argv, [&] {
    if (decode->parsed()) return holdfast::decode(options);
    const holdfast::Dbc dbc = holdfast::load(options);
    if (list->parsed()) {
      std::cout << holdfast::list_text(dbc);
    } else {
      std::vector<std::string> remarks;
      std::cout << holdfast::encode_text(dbc, options.message, options.signals, remarks) << '\n';
      for (const std::string& remark : remarks) std::cerr << holdfast::printable(remark) << '\n';
    }
    holdfast::finish_output(std::cout);
    return 0;
  });
}
