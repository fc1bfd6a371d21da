// SPDX-License-Identifier: BSD-3-Clause
// A stream that stays open: its levels and steps as arrays, with the bytes that are there already.
#ifndef tetlod_stream_h
#define tetlod_stream_h

#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <tetlod.h>

#include "tetlod_bytes.h"

// Failures are std::runtime_error; this one says that the work was to stop.
struct tetlod_cancelled : std::runtime_error
{
  tetlod_cancelled()
    : std::runtime_error("cancelled")
  {
  }
};

// Which level is meant. `level` decides where it is not negative; else the error, and then what the budgets allow.
struct tetlod_choice
{
  double error, abs_error; // abs_error: in the field's units, where it is not negative
  tetlod_measure measure;
  std::string field; // that the error is about; "": all that the stream controls
  int level;
  uint64_t tets, bytes; // 0: no budget
};

// Values of a field or of cells. `type`: as vtkType.h numbers them.
struct tetlod_column
{
  std::string name;
  int components, type;
  const double* values;
};

// A level or a step. What it points at is valid until the stream moves.
struct tetlod_view
{
  uint32_t vertices, tets;
  tetlod_type position_type;
  const double* positions;
  const uint32_t* corners;
  std::vector<tetlod_column> fields, cells;
  std::vector<std::pair<std::string, double>> facts; // what `tetlod extract` writes as field data
  std::string id;
};

class tetlod_stream
{
public:
  // Gets the part that is done, 0 to 1; true: stop.
  using progress_function = std::function<bool(double)>;
  using names = std::vector<std::string>;

  tetlod_stream(const std::string& place, const std::string& headers, progress_function progress);
  ~tetlod_stream();
  tetlod_stream(const tetlod_stream&) = delete;
  tetlod_stream& operator=(const tetlod_stream&) = delete;

  const struct tetlod_info& info() const { return *tetlod_info(whole); }
  const std::vector<double>& times() const { return all_times; }
  names field_names();
  names cell_names() const;

  // Of a stream without steps: the level that is meant, and what it holds. `warning`: of a file that is cut off.
  uint32_t level_for(const tetlod_choice& choice, std::string& warning) const;
  tetlod_view level(uint32_t level, const names& fields, const names& cells);
  uint32_t current_level() const;

  // Of a stream in pages: one mesh, `coarse` outside of the box X0, X1, Y0, Y1, Z0, Z1, `fine` in it. `has_region`: can
  // it be made with these levels? `coarse` may become finer then: no level before the pages has a mesh of this kind.
  uint32_t finest_region() const;
  bool has_region(uint32_t& coarse, uint32_t fine) const;
  tetlod_view region(uint32_t coarse, uint32_t fine, const double* box, const names& fields, const names& cells);

  // Of a series: the band of the step whose time is nearest.
  uint32_t band_for(double time, const tetlod_choice& choice);
  uint32_t coarse_band(double time, uint64_t tets);
  tetlod_view step(double time, uint32_t band, const names& fields, const names& cells);

private:
  // The stream itself, or a topology group of it.
  struct part
  {
    tetlod_file* file = nullptr;
    uint64_t offset = 0; // of its bytes in the whole
    tetlod_cursor* cursor = nullptr;
    tetlod_series* series = nullptr;
    std::vector<bool> decoded; // the cursor's fields
    bool some_pages = false;   // the cursor has not all
    std::map<std::string, std::vector<double>> cells, chosen; // chosen: those of a region
    std::vector<double> moved;                                // positions at a step
  };

  void check(tetlod_status status, const tetlod_error& error) const;
  void expect(uint64_t offset, uint64_t size);
  part& part_of(double time, uint32_t& step);
  std::vector<uint32_t> numbers_of(const names& fields) const;
  void fetch(const part& at, const std::vector<uint32_t>& fields, uint32_t level, const tetlod_page_set* pages);
  void make_cursor(part& at, const std::vector<uint32_t>& fields, const tetlod_page_set* pages);
  void move(part& at, uint32_t level, const std::vector<uint32_t>& fields, const tetlod_page_set* pages = nullptr);
  tetlod_view view_of(part& at, uint32_t level, const std::vector<uint32_t>& fields) const;
  void read_series(part& at, uint32_t band, uint32_t step, const names& fields);
  void add_cells(part& at, const names& wanted, tetlod_view& view, int64_t step);
  void add_parts(part& at, uint32_t coarse, uint32_t fine, tetlod_view& view);

  std::unique_ptr<tetlod_bytes> bytes;
  tetlod_source source;
  tetlod_file* whole = nullptr;
  progress_function progress;
  std::map<uint32_t, part> parts;
  std::vector<double> all_times;
};

#endif
