#include "tools/log_compare.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <regex>
#include <set>
#include <span>

#include "common/errors.h"
#include "common/log_file.h"
#include "tools/log_fields.h"
#include "tools/log_meta.h"
#include "tools/printable_text.h"
#include "tools/scenario_facts.h"

namespace holdfast {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr int kDifferencesPerMessage = 3;
constexpr std::string_view kIgnoredFields[] = {"seq", "measurement_seq", "receive_utime", "bus"};

bool is_left_out(const std::string& channel) {
  return channel == "RUN_META" || channel.starts_with("TIMING_") || channel.starts_with("STATUS_");
}

// One value in a message, with the path to it.
struct Leaf {
  std::string path;
  std::uint64_t bits = 0;
  std::string text;  // of a string; numbers are written when they are shown
  const FieldLayout* field = nullptr;
};

// Collects the values of a message that count.
class LeafCollector {
 public:
  explicit LeafCollector(std::vector<Leaf>& leaves) : leaves_(leaves) {}

  void enter(const FieldLayout& field, std::int64_t i) {
    prefix_ends_.push_back(prefix_.size());
    prefix_ += name_of(field, i) + '.';
  }
  void leave(const FieldLayout&) {
    prefix_.resize(prefix_ends_.back());
    prefix_ends_.pop_back();
  }
  void begin_field(const FieldLayout& field, std::int64_t) {
    is_ignored_ =
        std::ranges::find(kIgnoredFields, std::string_view(field.name)) != std::end(kIgnoredFields);
  }
  void value(const FieldLayout& field, std::int64_t i, const FieldValue& value) {
    if (is_ignored_) return;
    leaves_.push_back({prefix_ + name_of(field, i), value.bits, std::string(value.text), &field});
  }

 private:
  static std::string name_of(const FieldLayout& field, std::int64_t i) {
    return field.is_array ? field.name + ('[' + std::to_string(i) + ']') : field.name;
  }

  std::vector<Leaf>& leaves_;
  std::string prefix_;
  std::vector<std::size_t> prefix_ends_;
  bool is_ignored_ = false;
};

void collect_leaves(const TypeLayout& type, Bytes message, std::vector<Leaf>& leaves) {
  LeafCollector collector(leaves);
  FieldReader(message).read(type, collector);
}

std::string shown(const Leaf& leaf) {
  if (leaf.field->kind == FieldKind::kString) return '\'' + printable(leaf.text, 80) + '\'';
  const std::string text = field_text(*leaf.field, leaf.bits);
  if (text != "nan") return text;
  char bits[32];
  std::snprintf(bits, sizeof bits, "nan (0x%016llx)", static_cast<unsigned long long>(leaf.bits));
  return bits;
}

// Messages of one log by channel and step; for channels that are none of ours all stand at step 0.
struct LogMessages {
  using BySteps = std::map<std::int64_t, std::vector<std::vector<std::uint8_t>>>;
  std::map<std::string, BySteps> channels;
  std::map<std::string, std::int64_t> refused;
  std::set<std::string> campaign_only;  // channels that a live run of this scenario cannot have
};

// Step of a message: every type of ours that has a step has it as third field.
std::int64_t step_of(Bytes bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < 8; ++i) value = (value << 8) | bytes[kFingerprintBytes + 16 + i];
  return static_cast<std::int64_t>(value);
}

// What follows the step: of an attack signal its name and values.
Bytes after_step(const std::vector<std::uint8_t>& message) {
  return Bytes(message).subspan(kFingerprintBytes + 24);
}

class LogComparison {
 public:
  LogComparison(const CompareOptions& options, CompareResult& result)
      : options_(options), result_(result) {}

  LogMessages read(const std::string& file, const std::regex& wanted) {
    LogMessages log;
    read_scenario(file, log);
    LogReader reader(file);
    LogEvent event;
    while (reader.next(event)) {
      if (is_left_out(event.channel) || !std::regex_match(event.channel, wanted)) continue;
      const ChannelType type = channel_type(event.channel);
      if (type.layout == nullptr) {
        log.channels[event.channel][0].push_back(event.data);
      } else if (check_wire(*type.layout, type.fingerprint, event.data) != GuardVerdict::kOk) {
        ++log.refused[event.channel];
      } else {
        log.channels[event.channel][step_of(event.data)].push_back(event.data);
      }
    }
    sort_signals(log);
    describe(file, log, reader);
    return log;
  }

  void compare(const LogMessages& a, const LogMessages& b) {
    std::set<std::string> channels;
    for (const auto& [channel, steps] : a.channels) channels.insert(channel);
    for (const auto& [channel, steps] : b.channels) channels.insert(channel);
    for (const std::string& channel : channels) {
      const auto in_a = a.channels.find(channel), in_b = b.channels.find(channel);
      if (in_a == a.channels.end() || in_b == b.channels.end()) {
        const std::string where =
            " stands only in " + std::string(in_a == a.channels.end() ? "B" : "A");
        if (a.campaign_only.contains(channel) && b.campaign_only.contains(channel)) {
          result_.notes.push_back(printable(channel, 60) + where +
                                  ": only a campaign knows what it is told");
        } else {
          const bool is_smoothed = channel.starts_with("SMOOTHED_");
          result_.problems.push_back(printable(channel, 60) + where +
                                     (is_smoothed ? "; holdfast-smoother makes it of a log" : ""));
        }
        continue;
      }
      compare_channel(channel, in_a->second, in_b->second);
    }
  }

 private:
  // Plant and attacker both publish signals, and which of them is recorded first says nothing.
  static void sort_signals(LogMessages& log) {
    for (auto& [step, messages] : log.channels["ATTACK_SIGNAL"]) {
      std::ranges::stable_sort(messages, [](const auto& a, const auto& b) {
        return std::ranges::lexicographical_compare(after_step(a), after_step(b));
      });
    }
    if (log.channels["ATTACK_SIGNAL"].empty()) log.channels.erase("ATTACK_SIGNAL");
  }

  // Which channels only a campaign has, where a scenario says it.
  void read_scenario(const std::string& file, LogMessages& log) {
    try {
      const std::string scenario = read_logged_meta(file).meta.scenario;
      for (const std::string& channel :
           campaign_only_channels(read_scenario_facts(scenario, printable(file))))
        log.campaign_only.insert(channel);
    } catch (const UsageError& error) {
      result_.notes.push_back(printable(error.what()));
    }
  }

  void describe(const std::string& file, const LogMessages& log, const LogReader& reader) {
    const std::string place = printable(file) + ": ";
    if (reader.damaged_bytes() > 0) {
      result_.notes.push_back(place + std::to_string(reader.damaged_bytes()) +
                              " damaged bytes were skipped");
    }
    if (reader.tail_is_torn()) result_.notes.push_back(place + "ends in the middle of an event");
    for (const auto& [channel, count] : log.refused) {
      result_.notes.push_back(place + std::to_string(count) + " events on " +
                              printable(channel, 60) +
                              " are no messages of ours and were left out");
    }
    for (const auto& [channel, steps] : log.channels) {
      if (!channel_type(channel).is_once_per_step) continue;
      const auto repeated = std::count_if(
          steps.begin(), steps.end(), [](const auto& entry) { return entry.second.size() > 1; });
      if (repeated == 0) continue;
      result_.notes.push_back(place + printable(channel, 60) + " holds " +
                              std::to_string(repeated) +
                              " steps more than once: two producers, or two runs in one log");
    }
  }

  void compare_channel(const std::string& channel, const LogMessages::BySteps& a,
                       const LogMessages::BySteps& b) {
    static const std::vector<std::vector<std::uint8_t>> kNone;
    std::int64_t uneven_steps = 0, first_uneven = 0, in_a = 0, in_b = 0;
    std::set<std::int64_t> steps;
    for (const auto& [step, messages] : a) steps.insert(step);
    for (const auto& [step, messages] : b) steps.insert(step);
    for (const std::int64_t step : steps) {
      const auto found_a = a.find(step), found_b = b.find(step);
      const auto& messages_a = found_a == a.end() ? kNone : found_a->second;
      const auto& messages_b = found_b == b.end() ? kNone : found_b->second;
      in_a += static_cast<std::int64_t>(messages_a.size());
      in_b += static_cast<std::int64_t>(messages_b.size());
      if (messages_a.size() != messages_b.size() && uneven_steps++ == 0) first_uneven = step;
      const std::size_t both = std::min(messages_a.size(), messages_b.size());
      for (std::size_t i = 0; i < both; ++i)
        compare_message(channel, step, messages_a[i], messages_b[i]);
    }
    if (uneven_steps > 0) {
      result_.problems.push_back(
          printable(channel, 60) + ": " + std::to_string(in_a) + " messages in A, " +
          std::to_string(in_b) + " in B; " + std::to_string(uneven_steps) +
          " steps do not have as many in both, the first is step " + std::to_string(first_uneven));
    }
  }

  void compare_message(const std::string& channel, std::int64_t step, Bytes a, Bytes b) {
    ++result_.compared;
    ++result_.compared_by_channel[channel];
    const ChannelType type = channel_type(channel);
    if (type.layout == nullptr) {
      if (std::ranges::equal(a, b)) return;
      ++result_.differing;
      tell({channel, step, "(bytes)", std::to_string(a.size()) + " bytes",
            std::to_string(b.size()) + " bytes"});
      return;
    }
    leaves_a_.clear();
    leaves_b_.clear();
    collect_leaves(*type.layout, a, leaves_a_);
    collect_leaves(*type.layout, b, leaves_b_);
    bool is_same = leaves_a_.size() == leaves_b_.size();
    int told = 0;
    for (std::size_t i = 0; i < std::min(leaves_a_.size(), leaves_b_.size()); ++i) {
      const Leaf &in_a = leaves_a_[i], &in_b = leaves_b_[i];
      // After arrays of different lengths, which have been told, the rest stands at other places.
      if (in_a.path != in_b.path) break;
      if (in_a.bits == in_b.bits && in_a.text == in_b.text) continue;
      is_same = false;
      if (told++ < kDifferencesPerMessage)
        tell({channel, step, in_a.path, shown(in_a), shown(in_b)});
    }
    if (!is_same) ++result_.differing;
  }

  void tell(FieldDifference difference) {
    if (result_.differences.size() < options_.differences_max)
      result_.differences.push_back(std::move(difference));
  }

  const CompareOptions& options_;
  CompareResult& result_;
  std::vector<Leaf> leaves_a_, leaves_b_;
};

std::regex parse_expression(const std::string& text) {
  try {
    return std::regex(text);
  } catch (const std::regex_error&) {
    throw UsageError("--channels '" + printable(text) +
                     "' is no regular expression; an example: 'EST_.*|MEASUREMENT'");
  }
}

}  // namespace

CompareResult compare_logs(const std::string& file_a, const std::string& file_b,
                           const CompareOptions& options) {
  const std::regex wanted = parse_expression(options.channels);
  CompareResult result;
  LogComparison comparison(options, result);
  const LogMessages a = comparison.read(file_a, wanted);
  const LogMessages b = comparison.read(file_b, wanted);
  comparison.compare(a, b);
  std::error_code ignored;
  if (std::filesystem::equivalent(file_a, file_b, ignored)) {
    result.notes.push_back("A and B are the same file");
  }
  if (result.compared == 0) {
    result.problems.push_back("nothing was compared: no message on a channel that matches '" +
                              printable(options.channels) + "' stands in both logs");
  }
  result.is_equal = result.differing == 0 && result.problems.empty();
  return result;
}

std::string CompareResult::text() const {
  std::string text;
  for (const auto& [channel, count] : compared_by_channel) {
    text += printable(channel, 60) + ": " + std::to_string(count) + " messages compared\n";
  }
  for (const FieldDifference& d : differences) {
    text += printable(d.channel, 60) + " step " + std::to_string(d.step) + ' ' + d.field +
            ":\n  A " + d.value_a + "\n  B " + d.value_b + '\n';
  }
  for (const std::string& problem : problems) text += problem + '\n';
  for (const std::string& note : notes) text += "note: " + note + '\n';
  if (is_equal) return text + "equal to the bit\n";
  return text + "NOT equal: " + std::to_string(differing) + " of " + std::to_string(compared) +
         " compared messages differ\n";
}

}  // namespace holdfast
