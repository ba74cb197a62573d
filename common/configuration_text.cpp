#include "common/configuration_text.h"

#include <yaml-cpp/anchor.h>
#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "common/configuration.h"

namespace holdfast {
namespace {

// Counts without building anything, an alias in each place where it stands.
class ValueCounter : public YAML::EventHandler {
 public:
  ValueCounter(const std::string& place, std::size_t text_bytes)
      : place_(place), bytes_max_(2 * text_bytes + kBytesByAliasesMax) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { leaf(mark, anchor, 0); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                const std::string& text) override {
    leaf(mark, anchor, text.size());
  }
  void OnAlias(const YAML::Mark&, YAML::anchor_t anchor) override {
    const auto found = sizes_.find(anchor);
    if (found == sizes_.end()) throw ConfigurationError(place_ + ": nested within itself");
    size_.values += found->second.values;
    size_.bytes += found->second.bytes;
    if (size_.values > kValuesMax || size_.bytes > bytes_max_)
      throw ConfigurationError(place_ + ": aliases (*) make it too large");
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(mark, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(mark, anchor);
  }
  void OnMapEnd() override { close(); }

 private:
  struct Size {
    std::size_t values = 0, bytes = 0;
  };
  static constexpr std::size_t kBytesByAliasesMax = 1 << 20;

  void count(const YAML::Mark& mark, std::size_t bytes) {
    size_.bytes += bytes;
    if (++size_.values <= kValuesMax) return;
    throw ConfigurationError(place_ + ":" + std::to_string(mark.line + 1) + ": more than " +
                             std::to_string(kValuesMax) +
                             " values, keys and lists, defaults included, are too many; long "
                             "samples can come from a file (docs/scenario.md, Limits)");
  }
  void leaf(const YAML::Mark& mark, YAML::anchor_t anchor, std::size_t bytes) {
    count(mark, bytes);
    if (anchor != YAML::NullAnchor) sizes_[anchor] = {1, bytes};
  }
  void open(const YAML::Mark& mark, YAML::anchor_t anchor) {
    open_.emplace_back(anchor, size_);
    count(mark, 0);
  }
  void close() {
    const auto [anchor, before] = open_.back();
    open_.pop_back();
    if (anchor != YAML::NullAnchor)
      sizes_[anchor] = {size_.values - before.values, size_.bytes - before.bytes};
  }

  const std::string& place_;
  const std::size_t bytes_max_;
  Size size_;
  std::map<YAML::anchor_t, Size> sizes_;  // of what has an anchor and is complete
  std::vector<std::pair<YAML::anchor_t, Size>> open_;
};

// yaml-cpp keeps each token of a flow list that may still become a key, before it tells of any.
void check_num_marks(const std::string& text, const std::string& place) {
  constexpr std::ptrdiff_t kMarksMax = 4 * kValuesMax;
  const auto is_mark = [](char c) { return c == ',' || c == '[' || c == '{'; };
  if (std::ranges::count_if(text, is_mark) > kMarksMax) {
    throw ConfigurationError(place + ": more than " + std::to_string(kMarksMax) +
                             " commas and opened brackets are too many");
  }
}

// Documents in the text, counted up to two by hand: where a comma stands in front of one
// YAML::LoadAll never comes to an end.
int count_documents(const std::string& text, const std::string& place) {
  check_num_marks(text, place);
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  ValueCounter counter(place, text.size());
  int num_documents = 0;
  while (num_documents < 2 && parser.HandleNextDocument(counter)) ++num_documents;
  return num_documents;
}

// Nodes below this one, an alias counted in each place where it stands, up to `most`; nullopt where
// they are nested too deeply, as in one that holds itself.
std::optional<std::size_t> count_nodes(const YAML::Node& node, std::size_t most, int depth = 0) {
  constexpr int kDepthMax = 100;
  if (depth > kDepthMax) return std::nullopt;
  std::size_t count = 1;
  for (const auto& entry : node) {
    if (count > most) break;
    const auto below = count_nodes(node.IsMap() ? entry.second : entry, most - count, depth + 1);
    if (!below) return std::nullopt;
    count += *below;
  }
  return count;
}

}  // namespace

std::string shortest_text(double value) {
  if (std::isinf(value)) return value > 0.0 ? ".inf" : "-.inf";
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

bool Interval::contains(double value) const {
  return (low_is_open ? value > low : value >= low) && value <= high;
}

std::string Interval::text() const {
  if (std::isinf(high) && low == 0.0) return low_is_open ? "above 0" : "0 or more";
  std::ostringstream text;
  text.precision(10);
  text << "in " << (low_is_open ? "(" : "[") << low << ", " << high << "]";
  return text.str();
}

void check_num_values(const std::string& text, const std::string& place) {
  count_documents(text, place);
}

YAML::Node one_document(const std::string& text, const std::string& place) {
  if (count_documents(text, place) > 1) return YAML::Node(YAML::NodeType::Undefined);
  return YAML::Load(text);
}

void require_finite(const YAML::Node& document, const std::string& place) {
  constexpr std::size_t kMost = 2 * kValuesMax;
  const std::optional<std::size_t> count = count_nodes(document, kMost);
  if (!count) throw ConfigurationError(place + ": nested more than 100 deep, or within itself");
  if (*count > kMost) throw ConfigurationError(place + ": aliases (*) make it too large");
}

}  // namespace holdfast
