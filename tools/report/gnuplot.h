#pragma once

#include <filesystem>
#include <string>

namespace holdfast {

/// True when a program gnuplot stands on PATH.
bool has_gnuplot();

/// Runs gnuplot on a script of this folder, in the folder, without a shell and without the user's
/// own settings. Throws JobError: gnuplot is missing (names the Debian package), or says that
/// something went wrong.
void run_gnuplot(const std::filesystem::path& folder, const std::string& script);

}  // namespace holdfast
