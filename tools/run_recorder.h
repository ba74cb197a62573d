#pragma once

#include <functional>
#include <holdfast/run_meta_t.hpp>
#include <string>

#include "common/lcm_link.h"
#include "common/log_file.h"
#include "common/run_meta.h"

namespace holdfast {

/// Records every message of a run into an LCM log whose first event is RUN_META.
///
/// Our own recorder, not lcm-logger: that one keeps LCM's queue of 30 messages per channel and
/// loses what comes faster, without a word.
class RunRecorder {
 public:
  using OnFailure = std::function<void(const std::string&)>;

  /// Begins to record. Throws JobError when the file cannot be written; later on, on_failure is
  /// told, once.
  RunRecorder(LcmLink& link, const std::string& file, RunMeta meta, OnFailure on_failure);

  /// Publishes RUN_META for those who join late.
  void publish_meta();
  /// Hands to the kernel what memory still holds.
  void flush();

  /// Publishes the run's last RUN_META. Datagrams come in order, so all that came before stands in
  /// the log when has_last_word().
  void publish_last_word();
  bool has_last_word() const { return has_last_word_; }

 private:
  void record(const std::string& channel, std::int64_t utime, std::span<const std::uint8_t> bytes);
  void guard(const std::function<void()>& work);

  LcmLink& link_;
  LogWriter log_;
  RunMeta meta_;
  OnFailure on_failure_;
  std::int64_t last_word_utime_ = -1;
  bool has_last_word_ = false, has_failed_ = false;
};

}  // namespace holdfast
