#pragma once

#include <string>

namespace holdfast {

/// Listens to a bus for so long, writes nothing to it, and prints what arrives, named by the DBC
/// file if there is one. Returns the exit status: 1 when nothing arrived. Throws UsageError for a
/// bus or file that cannot be read.
int look_at_bus(const std::string& bus_url, const std::string& dbc_file, double seconds);

}  // namespace holdfast
