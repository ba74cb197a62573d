#pragma once

#include <stdexcept>
#include <string>

namespace holdfast {

/// Wrong use or a wrong file: programs print it and exit 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The job could not be done though it was asked for rightly: programs print it and exit 1.
class JobError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace holdfast
