// Writes one valid input for each type and array length into the folder named, for a fuzzer to
// begin with.

#include <fstream>
#include <iostream>

#include "tests/support/message_types.h"
#include "tests/support/wire_sample.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: lcm_guard_seeds FOLDER" << std::endl;
    return 2;
  }
  char index = 0;
  holdfast::testing::for_each_message_type([&]<class Message>() {
    for (const int num_elements : {0, 1, 3}) {
      holdfast::testing::WireSample sample;
      holdfast::testing::append_fields(sample, *holdfast::layouts::of<Message>, num_elements);
      std::ofstream file(
          std::string(argv[1]) + "/" + Message::getTypeName() + "-" + std::to_string(num_elements),
          std::ios::binary);
      file.put(index);
      file.write(reinterpret_cast<const char*>(sample.bytes.data()),
                 static_cast<std::streamsize>(sample.bytes.size()));
    }
    ++index;
  });
}
