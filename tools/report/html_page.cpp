#include "tools/report/html_page.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <functional>
#include <string_view>

#include "tools/printable_text.h"
#include "tools/report/figure_data.h"
#include "tools/report/page_json.h"
#include "tools/report/report_assets.h"

namespace holdfast {
namespace {

std::string escaped(const std::string& text) {
  return printable_xml(text, kPageTextBytesMax);
}

// Lines of the text, each escaped, since printable text has no line ends of its own.
std::string escaped_lines(const std::string& text) {
  std::string lines;
  std::size_t from = 0;
  for (;;) {
    const std::size_t to = text.find('\n', from);
    lines += escaped(text.substr(from, to == std::string::npos ? to : to - from));
    if (to == std::string::npos) return lines;
    lines += '\n';
    from = to + 1;
  }
}

std::string element(const std::string& tag, const std::string& text,
                    const std::string& name_class = "") {
  const std::string attribute = name_class.empty() ? "" : " class=\"" + name_class + "\"";
  return "<" + tag + attribute + ">" + text + "</" + tag + ">\n";
}

bool looks_like_number(const std::string& cell) {
  return !cell.empty() && (std::isdigit(static_cast<unsigned char>(cell.front())) != 0 ||
                           (cell.size() > 1 &&
                            std::string_view("-+.").find(cell.front()) != std::string_view::npos &&
                            std::isdigit(static_cast<unsigned char>(cell[1])) != 0));
}

// A column of numbers, empty cells aside, stands flush right, its heading too.
bool is_number_column(const ReportTable& table, std::size_t column) {
  bool has_number = false;
  for (const auto& row : table.rows) {
    if (column >= row.size() || row[column].empty() || row[column] == "-") continue;
    if (!looks_like_number(row[column])) return false;
    has_number = true;
  }
  return has_number;
}

std::string table_html(const ReportTable& table) {
  const auto cells = [&table](const std::string& tag, const std::vector<std::string>& texts) {
    std::string row;
    for (std::size_t i = 0; i < texts.size(); ++i) {
      row += element(tag, escaped(texts[i]), is_number_column(table, i) ? "number" : "");
    }
    return element("tr", row);
  };
  std::string rows;
  for (const auto& row : table.rows) rows += cells("td", row);
  std::string html = element("h2", escaped(table.title));
  html += "<div class=\"table\"><table>\n" + element("thead", cells("th", table.header)) +
          element("tbody", rows) + "</table></div>\n";
  if (!table.note.empty()) html += element("p", escaped(table.note), "note");
  return html;
}

std::string warnings_html(const std::vector<std::string>& warnings) {
  if (warnings.empty()) return "";
  std::string items;
  for (const std::string& warning : warnings) items += element("li", escaped(warning));
  return "<div class=\"warnings\" role=\"note\"><strong>Warnings</strong>" + element("ul", items) +
         "</div>\n";
}

std::string contents_html(const std::vector<Figure>& figures) {
  std::string items;
  for (std::size_t i = 0; i < figures.size(); ++i) {
    items += element("li", "<a href=\"#figure-" + std::to_string(i + 1) + "\">" +
                               escaped(figures[i].title) + "</a>");
  }
  return element("ol", items, "contents");
}

std::string figure_html(const Figure& figure, std::size_t number, const std::string& chart) {
  const bool is_drawn = has_data(figure);
  std::string html = std::string("<section class=\"figure") + (is_drawn ? "" : " no-data") +
                     "\" id=\"figure-" + std::to_string(number) + "\">\n<div class=\"head\">" +
                     element("h3", escaped(figure.title)) +
                     "<div class=\"buttons\"></div></div>\n" +
                     element("div", is_drawn ? chart : element("p", "no data", "empty"), "chart");
  if (!figure.note.empty()) html += element("p", escaped(figure.note), "note");
  return html + "</section>\n";
}

std::string footer_html(const ReportAssets& assets) {
  std::string html = "Made by Holdfast.";
  if (!assets.uplot_licence.empty()) {
    html +=
        " Charts: uPlot, under the MIT licence." +
        element("details", element("summary", "Its licence") +
                               element("pre", escaped_lines(std::string(assets.uplot_licence))));
  }
  return element("footer", html);
}

std::string styles_html(const ReportAssets& assets) {
  std::string html;
  for (const std::string_view style : {assets.uplot_style, assets.style}) {
    if (!style.empty()) html += "<style>" + std::string(style) + "</style>\n";
  }
  return html;
}

struct Charts {
  std::string hint;
  std::function<std::string(std::size_t)> chart;  // what stands for the figure of this index
  std::string scripts;
  std::size_t num_drawn = 0;
};

// The policy lets the page load nothing and run nothing but the parts that this build put in.
std::string page_html(const Report& report, const ReportAssets& assets, const Charts& charts) {
  std::string figures;
  for (std::size_t i = 0; i < report.figures.size(); ++i) {
    figures += figure_html(report.figures[i], i + 1, charts.chart(i));
  }
  std::string html = "<!DOCTYPE html>\n<html lang=\"en\" data-figures=\"" +
                     std::to_string(report.figures.size()) + "\" data-drawn=\"" +
                     std::to_string(charts.num_drawn) + "\">\n<head>\n<meta charset=\"utf-8\">\n";
  html += "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src " +
          std::string(assets.script_policy) + "; style-src " + std::string(assets.style_policy) +
          "; img-src data: blob:; base-uri 'none'; form-action 'none'\">\n"
          "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n" +
          element("title", escaped(report.title)) + styles_html(assets) +
          "</head>\n<body>\n<header>\n" + element("h1", escaped(report.title));
  if (!report.subtitle.empty()) html += element("p", escaped_lines(report.subtitle), "subtitle");
  html += "</header>\n<main>\n" + warnings_html(report.warnings);
  for (const ReportTable& table : report.tables) html += table_html(table);
  if (!report.figures.empty()) {
    html += element("h2", "Figures") + contents_html(report.figures) +
            element("p", charts.hint, "hint") + figures;
  }
  return html + "</main>\n" + footer_html(assets) + charts.scripts + "</body>\n</html>\n";
}

std::string base64(const std::string& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      const std::uint32_t byte = i + j < bytes.size() ? static_cast<std::uint8_t>(bytes[i + j]) : 0;
      group = (group << 8) | byte;
    }
    for (std::size_t j = 0; j < 4; ++j) {
      text += i + j > bytes.size() ? '=' : kDigits[(group >> (18 - 6 * j)) & 63U];
    }
  }
  return text;
}

}  // namespace

std::string interactive_page(const Report& report) {
  const ReportAssets& assets = report_assets();
  Charts charts;
  charts.hint =
      "Drag across a chart to zoom in along x, drag aslant for y too; a double click shows "
      "everything again. Charts over the same x zoom together. A name in a legend hides its curve.";
  charts.chart = [](std::size_t) { return "<noscript>The charts need JavaScript.</noscript>"; };
  charts.scripts = "<script type=\"application/json\" id=\"data\">" + page_json(report.figures) +
                   "</script>\n<script>" + std::string(assets.uplot_script) +
                   "</script>\n<script>" + std::string(assets.script) + "</script>\n";
  return page_html(report, assets, charts);
}

std::string static_page(const Report& report, const std::vector<std::string>& svg_pictures) {
  ReportAssets assets;
  assets.style = report_assets().style;
  assets.script_policy = "'none'";
  assets.style_policy = report_assets().style_policy;
  Charts charts;
  charts.hint =
      "These are pictures, since this build lacks the library for charts that zoom: run "
      "scripts/setup where npm is, and build again.";
  charts.num_drawn = static_cast<std::size_t>(
      std::count_if(report.figures.begin(), report.figures.end(), has_data));
  charts.chart = [&](std::size_t i) {
    // As an image it can neither run nor load anything, whatever it holds.
    return "<img class=\"picture\" alt=\"" + escaped(report.figures[i].title) +
           "\" src=\"data:image/svg+xml;base64," + base64(svg_pictures.at(i)) + "\">";
  };
  return page_html(report, assets, charts);
}

}  // namespace holdfast
