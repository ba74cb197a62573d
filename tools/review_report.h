#pragma once

#include <string>

#include "tools/log_review.h"
#include "tools/path_plot.h"
#include "tools/review_json.h"
#include "tools/review_metrics.h"

namespace holdfast {

/// The review as aligned plain text, for a terminal: text from the log is made printable.
std::string review_table(const RunReview& review);

/// The metrics over several logs in the same form.
std::string combined_table(const CombinedReview& combined);

/// Truth, estimates and sensors of the review in the plane.
PathPlot path_plot_of(const RunReview& review);

/// Reviews a log and writes review.txt, review.json and report.html to the folder (made when
/// missing), and path.svg when the scenario's group "position" has two states. Returns the table.
/// Where no page can be drawn, the table says so instead. Throws UsageError for a log that cannot
/// be reviewed and JobError for a folder that cannot be written.
std::string write_review_report(const std::string& log_file, const std::string& folder);
std::string write_review_report(const ReviewedLog& log, const std::string& folder);

/// Makes a folder and those above it; throws JobError.
void make_folder(const std::string& folder);

/// Writes text to a file; throws JobError.
void write_text_file(const std::string& file, const std::string& text);

}  // namespace holdfast
