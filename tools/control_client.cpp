#include "tools/control_client.h"

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "common/errors.h"
#include "drivers/control_socket.h"

namespace holdfast {
namespace {

using ControlJson = nlohmann::ordered_json;

ControlJson ask(ControlConnection& attacker, const ControlJson& request) {
  return ControlJson::parse(
      attacker.ask(request.dump(-1, ' ', false, ControlJson::error_handler_t::replace)));
}

double seconds_of(const std::string& text) {
  char* end = nullptr;
  const double seconds = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(seconds > 0.0))
    throw UsageError("watch needs a number of seconds, not '" + text + "'");
  return seconds;
}

ControlJson request_of(const std::string& order, const std::string& argument) {
  ControlJson request = {{"do", order}};
  const bool takes_file = order == "add" || order == "change" || order == "swap";
  if (takes_file) {
    std::ifstream file(argument);
    if (!file) throw UsageError(order + " needs a YAML file; cannot read '" + argument + "'");
    request[order == "swap" ? "rules" : "rule"] =
        std::string(std::istreambuf_iterator<char>(file), {});
  } else if (order == "watch") {
    request["timeout_s"] = seconds_of(argument);
  } else if (!argument.empty()) {
    request["name"] = argument;
  }
  return request;
}

}  // namespace

int send_order(const std::string& path, const std::string& order, const std::string& argument) {
  ControlConnection attacker(path);
  const ControlJson answer = ask(attacker, request_of(order, argument));
  if (!answer.value("ok", false)) throw UsageError(answer.value("error", "refused"));
  std::cout << "generation " << answer["generation"] << "  step " << answer["step"] << std::endl;
  for (const ControlJson& rule : answer.value("rules", ControlJson::array())) {
    std::cout << (rule["paused"] ? "paused  " : "active  ") << rule["name"].get<std::string>()
              << "  " << rule["action"].get<std::string>() << "  acted " << rule["acted"] << '\n';
  }
  // Stays, so that its end is what pauses the rules.
  const double timeout_s = order == "watch" ? seconds_of(argument) : 0.0;
  while (timeout_s > 0.0) {
    attacker.wait(0.3 * timeout_s);
    ask(attacker, {{"do", "ping"}});
  }
  return 0;
}

}  // namespace holdfast
