#include "common/configuration_text.h"

#include <yaml-cpp/eventhandler.h>

#include <optional>
#include <sstream>

#include "common/configuration.h"

namespace holdfast {
namespace {

// Counts without building anything.
class ValueCounter : public YAML::EventHandler {
 public:
  explicit ValueCounter(const std::string& place) : place_(place) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                const std::string&) override {
    count(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnMapEnd() override {}

 private:
  void count(const YAML::Mark& mark) {
    if (++num_values_ <= kValuesMax) return;
    throw ConfigurationError(place_ + ":" + std::to_string(mark.line + 1) + ": more than " +
                             std::to_string(kValuesMax) +
                             " values, keys and lists, defaults included, are too many; long "
                             "samples can come from a file (docs/scenario.md, Limits)");
  }

  const std::string& place_;
  std::size_t num_values_ = 0;
};

// Documents in the text, counted up to two by hand: where a comma stands in front of one
// YAML::LoadAll never comes to an end.
int count_documents(const std::string& text, const std::string& place) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  ValueCounter counter(place);
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

void check_num_values(const std::string& text, const std::string& place) {
  count_documents(text, place);
}

YAML::Node one_document(const std::string& text, const std::string& place) {
  if (count_documents(text, place) > 1) return YAML::Node(YAML::NodeType::Undefined);
  return YAML::Load(text);
}

void require_finite(const YAML::Node& document, const std::string& text, const std::string& place) {
  constexpr std::size_t kByAliasesMax = 100'000;
  const std::size_t most = text.size() + kByAliasesMax;
  const std::optional<std::size_t> count = count_nodes(document, most);
  if (!count) throw ConfigurationError(place + ": nested more than 100 deep, or within itself");
  if (*count > most) throw ConfigurationError(place + ": aliases (*) make it too large");
}

}  // namespace holdfast
