#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace holdfast {

class run_meta_t;

/// What RUN_META says of a run.
struct RunMeta {
  std::string name;
  std::string scenario;  // resolved YAML
  std::int64_t seed = 0;
  std::int64_t run = 0;
  std::string kernel;  // numeric kernel chosen at run time
};

/// Adds versions, commit, hash and wall time.
run_meta_t to_message(const RunMeta& meta);

/// Version of this build, and the commit that it was built from ("unknown" outside a checkout).
std::string version_text();
std::string commit_text();

/// 16 hexadecimal digits of stable_hash of the text.
std::string scenario_hash(const std::string& scenario);

/// Resolved scenario of a log: its first RUN_META. Throws UsageError when the log has none.
RunMeta read_run_meta(const std::string& log_file);

}  // namespace holdfast
