#pragma once

#include <string>

#include "tools/log_review.h"
#include "tools/path_plot.h"

namespace holdfast {

/// The review as aligned plain text, for a terminal: text from the log is made printable.
std::string review_table(const RunReview& review);

/// The review as one JSON object, indented by two; units stand in the keys. A number that is not
/// known is null. Packets are counted by label, not listed.
std::string review_json(const RunReview& review);

/// Truth, estimates and sensors of the review in the plane.
PathPlot path_plot_of(const RunReview& review);

/// Reviews a log and writes review.txt and review.json to the folder (made when missing), and
/// path.svg when the scenario's group "position" has two states. Returns the table. Throws
/// UsageError for a log that cannot be reviewed and JobError for a folder that cannot be written.
std::string write_review_report(const std::string& log_file, const std::string& folder);
std::string write_review_report(const RunReview& review, const std::string& folder);

/// Writes text to a file; throws JobError.
void write_text_file(const std::string& file, const std::string& text);

}  // namespace holdfast
