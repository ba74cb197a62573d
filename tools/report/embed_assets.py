#!/usr/bin/python3
"""Writes the scripts and styles of the report page as a C++ source of byte arrays.

usage: embed_assets.py OUTPUT.cpp [--uplot SCRIPT STYLE LICENCE] --style FILE.css --scripts FILE.js...

Without --uplot the page has no scripts: charts are then pictures. The sums of all parts go into
the source too: the page's policy lets a browser run these and nothing else.
"""
import argparse
import base64
import hashlib
import re


def read(path):
    with open(path, encoding="utf-8") as stream:
        return stream.read()


def in_page(name, text):
    """The text, proven not to end the element that it stands in."""
    if re.search(r"</(script|style)|<!--", text, flags=re.I):
        raise SystemExit(f"embed_assets: {name} holds what would end its element")
    return text.strip() + "\n"


def c_array(name, text):
    data = text.encode("utf-8")
    rows = (",".join(str(byte) for byte in data[i:i + 32]) for i in range(0, len(data), 32))
    return f"constexpr unsigned char {name}[] = {{\n" + ",\n".join(rows) + (",0};\n" if data else "0};\n")


def checksum(text):
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode() + "'"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output")
    parser.add_argument("--uplot", nargs=3, metavar=("SCRIPT", "STYLE", "LICENCE"))
    parser.add_argument("--style", required=True)
    parser.add_argument("--scripts", nargs="+", required=True)
    options = parser.parse_args()

    assets = dict.fromkeys(("uplot_script", "uplot_style", "uplot_licence", "script"), "")
    if options.uplot:
        script, style, licence = (read(path) for path in options.uplot)
        assets["uplot_licence"] = licence.strip() + "\n"
        assets["uplot_script"] = in_page("uPlot", "/*!\n" + licence.strip().replace("*/", "* /") + "\n*/\n" + script)
        assets["uplot_style"] = in_page("uPlot's style", style)
        assets["script"] = in_page("the page's script", "'use strict';\n" + "\n".join(map(read, options.scripts)))
    assets["style"] = in_page("the page's style", read(options.style))
    sums = [f"{kind} {checksum(assets[name])}" for kind, name in
            (("script", "uplot_script"), ("script", "script"), ("style", "uplot_style"), ("style", "style")) if assets[name]]

    def policy(kind):
        return " ".join(entry.split(" ", 1)[1] for entry in sums if entry.startswith(kind)) or "'none'"

    with open(options.output, "w", encoding="utf-8") as stream:
        stream.write('#include "tools/report/report_assets.h"\n\nnamespace holdfast {\nnamespace {\n\n')
        for name, text in assets.items():
            stream.write(c_array(f"k_{name}", text))
        stream.write("\nstd::string_view view(const unsigned char* data, std::size_t size) {\n"
                     "  return {reinterpret_cast<const char*>(data), size - 1};\n}\n\n}  // namespace\n\n"
                     "const ReportAssets& report_assets() {\n  static const ReportAssets assets = {\n")
        for name in ("uplot_script", "uplot_style", "uplot_licence", "script", "style"):
            stream.write(f"      view(k_{name}, sizeof k_{name}),\n")
        stream.write(f'      "{policy("script")}",\n      "{policy("style")}"}};\n  return assets;\n}}\n\n}}  // namespace holdfast\n')


main()
