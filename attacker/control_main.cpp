#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "drivers/file_descriptor.h"
#include "tools/program_options.h"

namespace holdfast {
namespace {

using Json = nlohmann::ordered_json;

struct ControlOptions {
  std::string socket, order, argument;
};

FileDescriptor connect_to(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) throw UsageError(path + ": too long for a socket");
  std::memcpy(address.sun_path, path.data(), path.size());
  FileDescriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw JobError(path + ": no attacker listens there: " + std::strerror(errno) +
                   " (start it with --control " + path + ")");
  }
  return socket;
}

Json ask(const FileDescriptor& socket, const Json& request) {
  const std::string line = request.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
  if (send(socket.get(), line.data(), line.size(), MSG_NOSIGNAL) !=
      static_cast<ssize_t>(line.size()))
    throw JobError("the attacker went away");
  std::string answer;
  for (char c = 0; c != '\n'; answer += c) {
    if (recv(socket.get(), &c, 1, 0) != 1)
      throw JobError("the attacker went away, or watches no more because this one was silent");
  }
  return Json::parse(answer);
}

double seconds_of(const std::string& text) {
  char* end = nullptr;
  const double seconds = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(seconds > 0.0))
    throw UsageError("watch needs a number of seconds, not '" + text + "'");
  return seconds;
}

Json request_of(const ControlOptions& options) {
  Json request = {{"do", options.order}};
  const bool takes_file =
      options.order == "add" || options.order == "change" || options.order == "swap";
  if (takes_file) {
    std::ifstream file(options.argument);
    if (!file)
      throw UsageError(options.order + " needs a YAML file; cannot read '" + options.argument +
                       "'");
    request[options.order == "swap" ? "rules" : "rule"] =
        std::string(std::istreambuf_iterator<char>(file), {});
  } else if (options.order == "watch") {
    request["timeout_s"] = seconds_of(options.argument);
  } else if (!options.argument.empty()) {
    request["name"] = options.argument;
  }
  return request;
}

int run(const ControlOptions& options) {
  const FileDescriptor socket = connect_to(options.socket);
  const Json answer = ask(socket, request_of(options));
  if (!answer.value("ok", false)) throw UsageError(answer.value("error", "refused"));
  std::cout << "generation " << answer["generation"] << "  step " << answer["step"] << std::endl;
  for (const Json& rule : answer.value("rules", Json::array())) {
    std::cout << (rule["paused"] ? "paused  " : "active  ") << rule["name"].get<std::string>()
              << "  " << rule["action"].get<std::string>() << "  acted " << rule["acted"] << '\n';
  }
  // Stays, so that its end is what pauses the rules.
  const double timeout_s = options.order == "watch" ? seconds_of(options.argument) : 0.0;
  while (timeout_s > 0.0) {
    pollfd ended{socket.get(), POLLIN, 0};
    poll(&ended, 1, static_cast<int>(300.0 * timeout_s));
    ask(socket, {{"do", "ping"}});
  }
  return 0;
}

}  // namespace
}  // namespace holdfast

int main(int argc, char** argv) {
  CLI::App app{"Changes the rules of a running holdfast-attacker."};
  app.footer(
      "Example:\n  holdfast-control /tmp/attacker.sock pause lie\n"
      "  holdfast-control /tmp/attacker.sock watch 2   # when this ends, all rules are paused");
  holdfast::ControlOptions options;
  app.add_option("socket", options.socket, "Path that the attacker has as --control")->required();
  app.add_option(
         "order", options.order,
         "list, add FILE, change FILE, remove RULE, pause [RULE], resume [RULE], swap FILE, "
         "watch SECONDS")
      ->required();
  app.add_option("argument", options.argument,
                 "Name of a rule, YAML file of a rule (swap: a list of rules), or seconds");
  return holdfast::run_command_line(app, "holdfast-control", argc, argv,
                                    [&] { return holdfast::run(options); });
}
