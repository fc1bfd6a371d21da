// SPDX-License-Identifier: BSD-3-Clause
// The bytes of a stream: a file's, or those of a URL, which are fetched by Range requests and kept.
#ifndef tetlod_bytes_h
#define tetlod_bytes_h

#include <functional>
#include <memory>
#include <string>

#include <tetlod.h>

class tetlod_bytes
{
public:
  // Asked several times a second while bytes arrive: true ends the request.
  using stop_function = std::function<bool()>;

  // `headers`: lines "Name: value" for requests. Throws std::runtime_error that says what is wrong with the place.
  static std::unique_ptr<tetlod_bytes> open(
    const std::string& place, const std::string& headers, stop_function stop);
  virtual ~tetlod_bytes() = default;

  static bool is_url(const std::string& place);

  // What libtetlod reads; borrowed.
  virtual tetlod_source source() = 0;

  // Fetches bytes that will be read, in as few requests as they need.
  virtual tetlod_status expect(uint64_t offset, uint64_t size) = 0;

  // What ended the last read that failed; "" where the library itself says it.
  virtual std::string problem() const = 0;
};

#endif
