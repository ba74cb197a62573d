#include "tools/run_recorder.h"

#include "common/clock.h"
#include "common/errors.h"

namespace holdfast {

RunRecorder::RunRecorder(LcmLink& link, const std::string& file, RunMeta meta, OnFailure on_failure)
    : link_(link), log_(file), meta_(std::move(meta)), on_failure_(std::move(on_failure)) {
  run_meta_t first = to_message(meta_);
  log_.write_message("RUN_META", wall_utime(), first);
  log_.flush();
  link_.record_all([this](const std::string& channel, std::int64_t utime,
                          std::span<const std::uint8_t> bytes) { record(channel, utime, bytes); });
}

void RunRecorder::record(const std::string& channel, std::int64_t utime,
                         std::span<const std::uint8_t> bytes) {
  // LCM's tools refuse events without data.
  if (channel == "LCM_SELF_TEST" || bytes.empty()) return;
  guard([&] { log_.write(channel, utime, {bytes.begin(), bytes.end()}); });
  if (last_word_utime_ < 0 || channel != "RUN_META") return;
  run_meta_t message;
  has_last_word_ =
      has_last_word_ || (decode_guarded(bytes, message) && message.utime == last_word_utime_);
}

// A log that could not be written once has a gap, so nothing is added to it any more.
void RunRecorder::guard(const std::function<void()>& work) {
  if (has_failed_) return;
  try {
    work();
  } catch (const JobError& error) {
    has_failed_ = true;
    on_failure_(error.what());
  }
}

void RunRecorder::publish_meta() {
  run_meta_t message = to_message(meta_);
  link_.publish("RUN_META", message);
}

void RunRecorder::flush() {
  guard([this] { log_.flush(); });
}

void RunRecorder::publish_last_word() {
  run_meta_t last = to_message(meta_);
  last_word_utime_ = last.utime;
  link_.publish("RUN_META", last);
}

}  // namespace holdfast
