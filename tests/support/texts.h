#pragma once

#include <fstream>
#include <sstream>
#include <string>

#include "tests/support/catch.h"

namespace holdfast::testing {

/// All of a file of the repository.
inline std::string file_text(const std::string& name) {
  std::ifstream stream(std::string(HOLDFAST_SOURCE_DIR) + "/" + name, std::ios::binary);
  REQUIRE(stream);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

inline bool mentions(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Fails, and shows the whole text, when the part is not in it.
inline void check_mentions(const std::string& text, const std::string& part) {
  INFO(text);
  CHECK(mentions(text, part));
}

}  // namespace holdfast::testing
