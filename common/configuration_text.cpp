#include "common/configuration_text.h"

#include <yaml-cpp/eventhandler.h>

#include <optional>
#include <sstream>

#include "common/configuration.h"

namespace holdfast {
namespace {

class NoEvents : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

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

YAML::Node one_document(const std::string& text) {
  // Counted by hand: where a comma stands in front of a document YAML::LoadAll never comes to an
  // end.
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  NoEvents none;
  if (parser.HandleNextDocument(none) && parser.HandleNextDocument(none))
    return YAML::Node(YAML::NodeType::Undefined);
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
