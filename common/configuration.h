#pragma once

#include <yaml-cpp/yaml.h>

#include <initializer_list>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/errors.h"

namespace holdfast {

/// The problems of a configuration file, at most a hundred, one a line, each with file:line:column.
class ConfigurationError : public UsageError {
 public:
  using UsageError::UsageError;
};

/// Closed or open interval that a number must lie in.
struct Interval {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_is_open = false;

  bool contains(double value) const;
  std::string text() const;
};

inline constexpr Interval kAnyNumber{};
inline constexpr Interval kPositive{0.0, std::numeric_limits<double>::infinity(), true};
inline constexpr Interval kNonNegative{0.0};
inline constexpr Interval kProbability{0.0, 1.0};

/// The shortest text that YAML reads back as the same number, which is not NaN.
std::string shortest_text(double value);

class ConfigurationDocument;

/// One map of a configuration file, read key by key.
///
/// A read() overwrites its value when the key is there, leaves the default when it is not, and
/// writes what holds now into the resolved document. Problems are collected, never thrown here:
/// ConfigurationDocument::finish() throws them all at once.
class ConfigurationMap {
 public:
  bool has(std::string_view key) const;
  /// Reports the key as missing when it is not there.
  void require(std::string_view key);

  /// An infinite number is refused unless the default is infinite.
  void read(std::string_view key, double& value, Interval allowed = kAnyNumber);
  /// The same, but the word "same" leaves the value that stands: one that is tied to another.
  void read_or_same(std::string_view key, double& value, Interval allowed = kAnyNumber);
  void read(std::string_view key, std::int64_t& value, Interval allowed = kAnyNumber);
  void read(std::string_view key, int& value, Interval allowed = kAnyNumber);
  void read(std::string_view key, bool& value);
  void read(std::string_view key, std::string& value);
  void read(std::string_view key, std::vector<std::string>& values);
  /// size 0: any length.
  void read(std::string_view key, std::vector<double>& values, std::size_t size = 0,
            Interval allowed = kAnyNumber);
  /// A number stands for size equal ones. Used for "per sensor or shared".
  void read_shared(std::string_view key, std::vector<double>& values, std::size_t size,
                   Interval allowed = kAnyNumber);
  /// Rows of equal length; columns 0: any.
  void read(std::string_view key, std::vector<std::vector<double>>& rows, std::size_t columns);
  template <class Choice>
  void read_choice(std::string_view key, Choice& value,
                   std::initializer_list<std::pair<const char*, Choice>> choices);

  /// The map below the key; an empty one, at this map's place, when there is none.
  ConfigurationMap map(std::string_view key);
  /// The maps in the list below the key, the first `most` of them; none when there is none.
  std::vector<ConfigurationMap> maps(std::string_view key, std::size_t most = 1024);
  /// What stands below the key, as it is: for parts that no schema names. Undefined when there is
  /// none. It goes into the resolved document unchanged.
  YAML::Node raw(std::string_view key);
  /// True when the key holds a plain value (not a map or list); its text.
  bool scalar_text(std::string_view key, std::string& text) const;

  /// False, and reported, where the document may name no files.
  bool may_read_file(std::string_view key);

  /// Reports a problem of the key (or of the map itself when the key is not there).
  void problem(std::string_view key, const std::string& text);
  /// Replaces what the resolved document says of the key.
  void resolve(std::string_view key, const YAML::Node& value);
  /// Leaves the key out of the resolved document; for a key whose meaning another key now holds.
  void forget(std::string_view key);
  std::string path(std::string_view key) const;

 private:
  friend class ConfigurationDocument;
  struct Shared;

  ConfigurationMap(std::shared_ptr<Shared> shared, YAML::Node node, YAML::Node resolved,
                   std::string path, YAML::Mark mark);
  YAML::Node take(std::string_view key);
  bool number(const YAML::Node& node, std::string_view key, double& value, Interval allowed);
  void choice_problem(std::string_view key, const std::string& given,
                      const std::vector<std::string>& names);

  std::shared_ptr<Shared> shared_;
  YAML::Node node_;
  YAML::Node resolved_;
  std::string path_;
  YAML::Mark mark_;
};

/// A configuration file being read: parse, read through root(), then finish().
class ConfigurationDocument {
 public:
  /// Parses a file; throws ConfigurationError when it is missing or no YAML map.
  /// overrides: "a.b.c=value"; a list item is named by its index or by its key "name". Throws
  /// UsageError for one that leads nowhere.
  static ConfigurationDocument from_file(const std::string& file,
                                         const std::vector<std::string>& overrides = {});
  static ConfigurationDocument from_text(const std::string& text, const std::string& file_name,
                                         const std::vector<std::string>& overrides = {});

  ConfigurationMap root();
  /// For a text that strangers wrote: no file that it names is opened.
  void forbid_files();
  /// Throws ConfigurationError with every problem found, unknown keys included.
  void finish();
  /// The document with every default written out; valid after finish().
  std::string resolved_text() const;
  const std::string& file_name() const;

 private:
  std::shared_ptr<ConfigurationMap::Shared> shared_;
};

template <class Choice>
void ConfigurationMap::read_choice(std::string_view key, Choice& value,
                                   std::initializer_list<std::pair<const char*, Choice>> choices) {
  std::string given;
  std::vector<std::string> names;
  for (const auto& [name, choice] : choices) {
    names.emplace_back(name);
    if (choice == value) given = name;
  }
  read(key, given);
  for (const auto& [name, choice] : choices) {
    if (given == name) {
      value = choice;
      return;
    }
  }
  choice_problem(key, given, names);
}

}  // namespace holdfast
