#include <string>

#include "tools/control_client.h"
#include "tools/program_options.h"

int main(int argc, char** argv) {
  CLI::App app{"Changes the rules of a running holdfast-attacker."};
  app.footer(
      "Example:\n  holdfast-control /tmp/attacker.sock pause lie\n"
      "  holdfast-control /tmp/attacker.sock watch 2   # when this ends, all rules are paused");
  std::string socket, order, argument;
  app.add_option("socket", socket, "Path that the attacker has as --control")->required();
  app.add_option(
         "order", order,
         "list, add FILE, change FILE, remove RULE, pause [RULE], resume [RULE], swap FILE, "
         "watch SECONDS")
      ->required();
  app.add_option("argument", argument,
                 "Name of a rule, YAML file of a rule (swap: a list of rules), or seconds");
  return holdfast::run_command_line(app, "holdfast-control", argc, argv,
                                    [&] { return holdfast::send_order(socket, order, argument); });
}
