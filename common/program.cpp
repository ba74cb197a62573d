#include "common/program.h"

#include <iostream>

#include "common/errors.h"
#include "common/run_meta.h"

namespace holdfast {

int run_program(const std::string& name, const std::function<int()>& body) {
  try {
    return body();
  } catch (const UsageError& error) {
    std::cerr << name << ": " << error.what() << std::endl;
    return 2;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << std::endl;
    return 1;
  }
}

std::string version_line(const std::string& name) {
  return name + " " + version_text() + " (" + commit_text() + ")";
}

}  // namespace holdfast
