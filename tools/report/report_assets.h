#pragma once

#include <string_view>

namespace holdfast {

/// Scripts and styles of the report page, put into the build by embed_assets.py. Where the plotting
/// library was not there, all but the style are empty.
struct ReportAssets {
  std::string_view uplot_script, uplot_style, uplot_licence;
  std::string_view script, style;
  std::string_view script_policy, style_policy;  // sources that the page's policy allows
};

const ReportAssets& report_assets();

}  // namespace holdfast
