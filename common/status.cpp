#include "common/status.h"

#include <cctype>
#include <holdfast/status_t.hpp>
#include <iostream>

#include "common/clock.h"

namespace holdfast {

std::string channel_name(const std::string& prefix, const std::string& name) {
  std::string channel = prefix;
  for (const char c : name) {
    const auto letter = static_cast<unsigned char>(c);
    channel += std::isalnum(letter) != 0 ? static_cast<char>(std::toupper(letter)) : '_';
  }
  return channel;
}

void StatusReporter::remark(const std::string& text) {
  remark_ = text;
  std::cerr << "holdfast " << name_ << ": " << text << std::endl;
  publish();
}

void StatusReporter::publish() {
  status_t message;
  message.utime = wall_utime();
  message.name = name_;
  message.state = static_cast<std::int32_t>(state_);
  message.step = step_;
  message.remark = remark_;
  const auto add = [&message](const std::string& name, std::int64_t value) {
    message.counter_name.push_back(name);
    message.counter_value.push_back(value);
  };
  for (const auto& [name, value] : counters_) add(name, value);
  const LinkCounters& link = link_.counters();
  add("lcm_received", link.received);
  add("lcm_kernel_drops", link.kernel_drops);
  add("lcm_refused", link.refused);
  add("lcm_lost", link.lost);
  add("lcm_out_of_order", link.out_of_order);
  add("lcm_handler_errors", link.handler_errors);
  add("lcm_publish_failures", link.publish_failures);
  for (const auto& [verdict, value] : link.refused_by_verdict) add("lcm_refused_" + verdict, value);
  message.num_counters = static_cast<std::int32_t>(message.counter_name.size());
  link_.publish(channel_name("STATUS_", name_), message);
}

}  // namespace holdfast
