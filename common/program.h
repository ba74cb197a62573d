#pragma once

#include <functional>
#include <string>

namespace holdfast {

/// Runs a program's body and turns what it throws into its exit status: UsageError 2, anything
/// else 1, each said on stderr after the program's name.
int run_program(const std::string& name, const std::function<int()>& body);

/// "holdfast-x 0.1.0 (commit)".
std::string version_line(const std::string& name);

}  // namespace holdfast
