// SPDX-License-Identifier: BSD-3-Clause
#include "tetlod_bytes.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <fcntl.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

namespace
{
class file_bytes : public tetlod_bytes
{
public:
  explicit file_bytes(const std::string& path)
    : descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC))
  {
    struct stat facts;
    if (descriptor < 0 || fstat(descriptor, &facts) != 0)
      throw std::runtime_error("cannot be opened: " + std::string(std::strerror(errno)));
    size = static_cast<uint64_t>(facts.st_size);
  }
  ~file_bytes() override { ::close(descriptor); }

  tetlod_source source() override { return { read, this, size }; }
  tetlod_status expect(uint64_t, uint64_t) override { return TETLOD_OK; }
  std::string problem() const override { return said; }

private:
  static tetlod_status read(void* opaque, uint64_t offset, void* buffer, size_t count)
  {
    auto self = static_cast<file_bytes*>(opaque);
    for (size_t done = 0; done < count;)
    {
      ssize_t got = pread(self->descriptor, static_cast<char*>(buffer) + done, count - done,
        static_cast<off_t>(offset + done));
      if (got < 0 && errno == EINTR)
        continue;
      if (got <= 0)
      {
        self->said = got < 0 ? std::strerror(errno) : "the file became shorter meanwhile";
        return TETLOD_ERR_IO;
      }
      done += static_cast<size_t>(got);
    }
    return TETLOD_OK;
  }

  int descriptor;
  uint64_t size = 0;
  std::string said;
};
}

bool tetlod_bytes::is_url(const std::string& place)
{
  return strncasecmp(place.c_str(), "http://", 7) == 0 || strncasecmp(place.c_str(), "https://", 8) == 0;
}

#ifdef TETLOD_CURL
#include <curl/curl.h>

namespace
{
constexpr uint64_t BLOCK = 1 << 14, FIRST = 1 << 16; // what is fetched at least, and at first
constexpr int WAIT_MS = 100;        // how late a request that is to stop may notice it
constexpr long MAX_REDIRECTIONS = 10, SILENCE_SECONDS = 60;

struct answer
{
  long status = 0;
  uint64_t total = 0; // of the whole, as Content-Range says
  std::vector<unsigned char> body;
};

size_t take_body(char* data, size_t one, size_t count, void* opaque)
{
  auto& body = static_cast<answer*>(opaque)->body;
  body.insert(body.end(), data, data + one * count);
  return one * count;
}

size_t take_header(char* line, size_t one, size_t count, void* opaque)
{
  const std::string text(line, one * count);
  const size_t slash = text.find('/');
  if (strncasecmp(text.c_str(), "content-range:", 14) == 0 && slash != std::string::npos)
    static_cast<answer*>(opaque)->total = std::strtoull(text.c_str() + slash + 1, nullptr, 10);
  return one * count;
}

// A host that does not answer Range requests sends all, which is kept.
class url_bytes : public tetlod_bytes
{
public:
  url_bytes(const std::string& place, const std::string& headers, stop_function stop)
    : url(place)
    , stopped(std::move(stop))
    , easy(curl_easy_init(), curl_easy_cleanup)
    , multi(curl_multi_init(), curl_multi_cleanup)
    , lines(nullptr, curl_slist_free_all)
  {
    if (!easy || !multi)
      throw std::runtime_error("out of memory");
    set_options(headers);
    find_stream();
    begin();
  }

  tetlod_source source() override { return { read, this, size }; }
  std::string problem() const override { return said; }

  tetlod_status expect(uint64_t offset, uint64_t count) override
  {
    if (whole || count == 0 || offset >= size)
      return TETLOD_OK;
    const uint64_t last = (std::min(offset + count, size) - 1) / BLOCK;
    for (uint64_t block = offset / BLOCK; block <= last; block++)
    {
      uint64_t end = block;
      if (here[block])
        continue;
      while (end < last && !here[end + 1])
        end++;
      const tetlod_status status = fetch(block, end);
      if (status != TETLOD_OK)
        return status;
      block = end;
    }
    return TETLOD_OK;
  }

private:
  static tetlod_status read(void* opaque, uint64_t offset, void* buffer, size_t count)
  {
    auto self = static_cast<url_bytes*>(opaque);
    const tetlod_status status = self->expect(offset, count);
    if (status == TETLOD_OK)
      std::memcpy(buffer, self->bytes.get() + offset, count);
    return status;
  }

  void set_options(const std::string& headers)
  {
    for (size_t start = 0; start < headers.size();)
    {
      const size_t end = std::min(headers.find('\n', start), headers.size());
      if (end > start)
      {
        curl_slist* longer = curl_slist_append(lines.get(), headers.substr(start, end - start).c_str());
        if (!longer)
          throw std::runtime_error("out of memory");
        lines.release();
        lines.reset(longer);
      }
      start = end + 1;
    }
    curl_easy_setopt(easy.get(), CURLOPT_HTTPHEADER, lines.get());
    curl_easy_setopt(easy.get(), CURLOPT_FOLLOWLOCATION, 1L);
    curl_easy_setopt(easy.get(), CURLOPT_MAXREDIRS, MAX_REDIRECTIONS);
    curl_easy_setopt(easy.get(), CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(easy.get(), CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(easy.get(), CURLOPT_LOW_SPEED_TIME, SILENCE_SECONDS);
    curl_easy_setopt(easy.get(), CURLOPT_USERAGENT, "vtkTetlodReader/" TETLOD_VERSION_STRING);
    curl_easy_setopt(easy.get(), CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(easy.get(), CURLOPT_HEADERFUNCTION, take_header);
  }

  // Waits for the answer in short turns, so that a request that is not wanted any more ends.
  CURLcode perform(tetlod_status& status)
  {
    CURLcode done = CURLE_FAILED_INIT;
    int running = 1, left = 0;
    curl_multi_add_handle(multi.get(), easy.get());
    while (running)
    {
      if (curl_multi_perform(multi.get(), &running) != CURLM_OK)
        break;
      if (running)
        curl_multi_poll(multi.get(), nullptr, 0, WAIT_MS, nullptr);
      if (running && stopped && stopped())
      {
        status = TETLOD_ERR_CANCELLED;
        break;
      }
    }
    while (CURLMsg* message = curl_multi_info_read(multi.get(), &left))
      if (message->msg == CURLMSG_DONE)
        done = message->data.result;
    curl_multi_remove_handle(multi.get(), easy.get());
    return done;
  }

  tetlod_status get(const char* range, answer& out)
  {
    tetlod_status status = TETLOD_OK;
    said.clear();
    curl_easy_setopt(easy.get(), CURLOPT_URL, url.c_str());
    curl_easy_setopt(easy.get(), CURLOPT_RANGE, range);
    curl_easy_setopt(easy.get(), CURLOPT_WRITEDATA, &out);
    curl_easy_setopt(easy.get(), CURLOPT_HEADERDATA, &out);
    const CURLcode done = perform(status);
    curl_easy_getinfo(easy.get(), CURLINFO_RESPONSE_CODE, &out.status);
    if (status != TETLOD_OK)
      return status;
    if (done != CURLE_OK)
      said = curl_easy_strerror(done);
    else if (out.status != 200 && out.status != 206)
      said = "the host answers with status " + std::to_string(out.status);
    return said.empty() ? TETLOD_OK : TETLOD_ERR_IO;
  }

  tetlod_status fetch(uint64_t first, uint64_t last)
  {
    answer got;
    const uint64_t from = first * BLOCK, end = std::min((last + 1) * BLOCK, size);
    const std::string range = std::to_string(from) + "-" + std::to_string(end - 1);
    const tetlod_status status = get(range.c_str(), got);
    if (status != TETLOD_OK)
      return status;
    if (got.status != 206 || got.total != size || got.body.size() != end - from)
    {
      said = "the file was replaced meanwhile; open it again";
      return TETLOD_ERR_IO;
    }
    std::memcpy(bytes.get() + from, got.body.data(), got.body.size());
    std::fill(here.begin() + static_cast<long>(first), here.begin() + static_cast<long>(last) + 1, true);
    return TETLOD_OK;
  }

  // The first block, which also says how long the whole is.
  void begin()
  {
    answer got;
    if (get(("0-" + std::to_string(FIRST - 1)).c_str(), got) != TETLOD_OK)
      throw std::runtime_error(said.empty() ? "cancelled" : "cannot be read: " + said);
    whole = got.status == 200;
    size = whole ? got.body.size() : got.total;
    if (size == 0 || got.body.size() > size || (!whole && got.body.size() < std::min(FIRST, size)))
      throw std::runtime_error("cannot be read: the host does not say how long the file is");
    bytes.reset(static_cast<unsigned char*>(std::malloc(size)));
    if (!bytes)
      throw std::runtime_error("out of memory: " + std::to_string(size) + " bytes");
    std::memcpy(bytes.get(), got.body.data(), got.body.size());
    here.assign(size / BLOCK + 1, false);
    std::fill_n(here.begin(), (std::min(FIRST, size) + BLOCK - 1) / BLOCK, true);
  }

  // A tetlod server's mesh, or the page that shows it: its stream is named by its content id.
  void find_stream()
  {
    static const char mesh[] = "/v1/meshes/", view[] = "/view/";
    std::string path = url.substr(0, url.find_first_of("?#")), query;
    if (url.find('?') != std::string::npos)
      query = url.substr(url.find('?'), url.find('#') - url.find('?'));
    size_t id = path.find(mesh);
    const size_t page = path.find(view);
    if (id == std::string::npos && page != std::string::npos)
    {
      path.replace(page, sizeof view - 1, mesh);
      id = page;
    }
    if (id == std::string::npos || path.find('/', id + sizeof mesh - 1) != std::string::npos)
      return;
    answer got;
    url = path + query;
    if (get(nullptr, got) != TETLOD_OK)
      throw std::runtime_error(said.empty() ? "cancelled" : "cannot be read: " + said);
    const std::string text(got.body.begin(), got.body.end());
    const size_t key = text.find("\"cid\""), quote = key == std::string::npos ? key : text.find('"', key + 5);
    if (quote == std::string::npos || text.size() < quote + 33)
      throw std::runtime_error("cannot be read: this is no mesh of a tetlod server");
    url = path + "/" + text.substr(quote + 1, 32) + "/stream" + query;
  }

  struct release
  {
    void operator()(unsigned char* held) const { std::free(held); }
  };

  std::string url, said;
  stop_function stopped;
  std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> easy;
  std::unique_ptr<CURLM, decltype(&curl_multi_cleanup)> multi;
  std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)> lines;
  std::unique_ptr<unsigned char, release> bytes; // [size]: only what was fetched takes memory
  std::vector<bool> here;                        // the blocks that were
  uint64_t size = 0;
  bool whole = false;
};
}

std::unique_ptr<tetlod_bytes> tetlod_bytes::open(
  const std::string& place, const std::string& headers, stop_function stop)
{
  if (is_url(place))
    return std::unique_ptr<tetlod_bytes>(new url_bytes(place, headers, std::move(stop)));
  return std::unique_ptr<tetlod_bytes>(new file_bytes(place));
}

#else

std::unique_ptr<tetlod_bytes> tetlod_bytes::open(const std::string& place, const std::string&, stop_function)
{
  if (is_url(place))
    throw std::runtime_error("this reader was built without libcurl: fetch the file first");
  return std::unique_ptr<tetlod_bytes>(new file_bytes(place));
}

#endif
