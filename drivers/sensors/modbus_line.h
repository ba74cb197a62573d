#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace holdfast {

/// DEVICE[@BAUD][?parity=even|odd|none][&stop=1|2]: a serial line that Modbus RTU units hang on.
/// Without options: 19200 baud, even parity, one stop bit, as the standard has it.
struct ModbusUrl {
  std::string device;
  int baud = 19200;
  char parity = 'E';  // or O, N
  int stop_bits = 1;

  /// Throws UsageError, which says what may stand there.
  static ModbusUrl parse(const std::string& url);
  /// Seconds for which the line has to be idle before each request.
  double gap_s() const;
};

/// What came of asking a unit.
enum class ModbusAnswer {
  kInputs,
  kSilent,     // no answer in time
  kBroken,     // an answer with a wrong checksum, of another unit, or of a wrong length
  kException,  // the unit says that it cannot
  kLineGone    // the line itself is not there
};

class ModbusContext;

/// The asking end of a Modbus RTU line. One thread; waits no longer than the time-out for a whole
/// answer.
class ModbusClient {
 public:
  /// Throws JobError when the line cannot be opened, or another program has locked it.
  ModbusClient(const ModbusUrl& url, double response_timeout_s);
  ~ModbusClient();

  /// Reads discrete inputs (function 2) of a unit, each as 0 or 1. What has come unasked is thrown
  /// away first. A line that fails is closed, and opened again by the next call. At most 2000
  /// inputs; they are only changed for kInputs. Precondition: the line was idle for its gap.
  ModbusAnswer read_inputs(int unit, int first_input, std::span<std::uint8_t> inputs);
  /// Why the last answer was not kInputs.
  const std::string& problem() const;

 private:
  std::unique_ptr<ModbusContext> context_;
};

/// The answering end, for one unit: discrete inputs only.
class ModbusServer {
 public:
  /// Throws JobError when the line cannot be opened, or another program has locked it.
  ModbusServer(const ModbusUrl& url, int unit);
  ~ModbusServer();

  int file_descriptor() const;
  /// Takes what has arrived: the first address of a request for this unit's inputs, else none, and
  /// then there is nothing to answer. What else is asked of the unit gets an exception. Throws
  /// JobError when the line is gone.
  std::optional<int> take_request();
  /// Answers the request that was taken last; inputs from first_input on, all others are an illegal
  /// address.
  void answer(int first_input, std::span<const std::uint8_t> inputs);

 private:
  std::unique_ptr<ModbusContext> context_;
  int unit_;
  std::vector<std::uint8_t> request_;
  int request_length_ = 0;
};

}  // namespace holdfast
