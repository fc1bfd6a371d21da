// SPDX-License-Identifier: BSD-3-Clause
#include "tetlod_stream.h"

#include <algorithm>
#include <cmath>

#include <vtkType.h>

namespace
{
constexpr uint32_t RECORDS = 1 << 12; // between two looks at whether to stop: some thousandths of a second
constexpr uint64_t GAP = 24 << 10;    // bytes between two pages that are fetched along, for one request less
const char PARTS[] = "Region";        // as `tetlod extract --box` names them: 0 coarse, 1 fine, 2 the transition

bool has(const std::vector<std::string>& names, const std::string& name)
{
  return std::find(names.begin(), names.end(), name) != names.end();
}

int vtk_type(tetlod_type type)
{
  return type == TETLOD_FLOAT32 ? VTK_FLOAT : VTK_DOUBLE;
}

int vtk_type(tetlod_cell_type type)
{
  switch (type)
  {
    case TETLOD_CELL_FLOAT32:
      return VTK_FLOAT;
    case TETLOD_CELL_INT8:
      return VTK_SIGNED_CHAR;
    case TETLOD_CELL_INT16:
      return VTK_SHORT;
    case TETLOD_CELL_INT32:
      return VTK_INT;
    case TETLOD_CELL_INT64:
      return VTK_LONG_LONG;
    default:
      return VTK_DOUBLE;
  }
}

std::string percent(double error)
{
  char text[32];
  snprintf(text, sizeof text, "%.4g %%", 100 * error);
  return text;
}

void add_fact(tetlod_view& view, const std::string& name, double error)
{
  if (!std::isnan(error))
    view.facts.emplace_back("tetlod_max_error " + name, error);
}
}

tetlod_stream::tetlod_stream(
  const std::string& place, const std::string& headers, progress_function asked)
  : bytes(tetlod_bytes::open(place, headers, [asked] { return asked(0); }))
  , source(bytes->source())
  , progress(std::move(asked))
{
  tetlod_error error = {};
  check(tetlod_open(&whole, &source, nullptr, &error), error);
  for (uint32_t t = 0; t < info().topology_count; t++)
  {
    const tetlod_topology& topology = info().topologies[t];
    all_times.insert(all_times.end(), topology.times, topology.times + topology.step_count);
  }
  uint32_t first = 0;
  part& at = part_of(0, first);
  if (all_times.empty() && at.series)
  {
    const struct tetlod_series_info* steps = tetlod_series_info(at.series);
    all_times.assign(steps->times, steps->times + steps->step_count);
  }
}

tetlod_stream::~tetlod_stream()
{
  for (auto& entry : parts)
  {
    tetlod_series_free(entry.second.series);
    tetlod_cursor_free(entry.second.cursor);
    if (entry.second.file != whole)
      tetlod_close(entry.second.file);
  }
  tetlod_close(whole);
}

void tetlod_stream::check(tetlod_status status, const tetlod_error& error) const
{
  if (status == TETLOD_ERR_CANCELLED)
    throw tetlod_cancelled();
  if (status != TETLOD_OK)
    throw std::runtime_error(!bytes->problem().empty() ? bytes->problem()
        : *error.message                               ? error.message
                                                       : tetlod_status_text(status));
}

void tetlod_stream::expect(uint64_t offset, uint64_t size)
{
  check(bytes->expect(offset, size), {});
}

tetlod_stream::names tetlod_stream::field_names()
{
  names found;
  uint32_t first = 0;
  const tetlod_series* series = part_of(0, first).series;
  const struct tetlod_series_info* steps = series ? tetlod_series_info(series) : nullptr;
  for (uint32_t f = 0; f < (steps ? steps->field_count : info().field_count); f++)
    found.emplace_back(info().fields[steps ? steps->fields[f] : f].name);
  return found;
}

tetlod_stream::names tetlod_stream::cell_names() const
{
  names found;
  for (uint32_t f = 0; f < info().cell_field_count; f++)
    found.emplace_back(info().cell_fields[f].name);
  return found;
}

// ---- which level, which part, which step

uint32_t tetlod_stream::level_for(const tetlod_choice& choice, std::string& warning) const
{
  const struct tetlod_info& in = info();
  const uint32_t finest = in.level_count - 1;
  const bool absolute = choice.abs_error >= 0;
  const double limit = absolute ? choice.abs_error : choice.error;
  uint32_t field = TETLOD_NONE, level = finest, here = finest;
  if (!choice.field.empty() && (field = tetlod_field_index(&in, choice.field.c_str())) == TETLOD_NONE)
    throw std::runtime_error("there is no field \"" + choice.field + "\"");
  if (choice.level > static_cast<int>(finest))
    throw std::runtime_error("there is no level " + std::to_string(choice.level) + "; the finest is " +
      std::to_string(finest));
  if (choice.level >= 0)
    level = static_cast<uint32_t>(choice.level);
  else if (limit > 0)
    level = absolute ? tetlod_level_for_abs_error(&in, limit, field, choice.measure)
                     : tetlod_level_for_error(&in, limit, field, choice.measure);
  if (level == TETLOD_NONE)
    throw std::runtime_error("no level has an error of at most " +
      (absolute ? std::to_string(limit) : percent(limit)) + ", " + tetlod_measure_name(choice.measure) +
      "; 0 takes the finest");
  if (choice.level < 0 && choice.tets)
    level = std::min(level, tetlod_level_for_tets(&in, choice.tets));
  if (choice.level < 0 && choice.bytes)
    level = std::min(level, tetlod_level_for_bytes(&in, choice.bytes));
  while (here > 0 && in.levels[here].end > source.size)
    here--;
  if (level > here)
    warning = "the file is cut off: it holds levels 0 to " + std::to_string(here) + " of " +
      std::to_string(finest) + ", and level " + std::to_string(level) + " is asked for";
  return std::min(level, here);
}

uint32_t tetlod_stream::current_level() const
{
  const auto found = parts.find(0);
  struct tetlod_mesh mesh = {};
  if (found == parts.end() || !found->second.cursor)
    return 0;
  tetlod_cursor_mesh(found->second.cursor, &mesh);
  return found->second.some_pages ? std::min(mesh.level, info().first_paged_level - 1) : mesh.level;
}

tetlod_stream::part& tetlod_stream::part_of(double time, uint32_t& step)
{
  const uint32_t found = tetlod_topology_for_time(&info(), time), number = found == TETLOD_NONE ? 0 : found;
  part& at = parts[number];
  tetlod_error error = {};
  if (!at.file && number == 0)
  {
    at.file = whole;
    at.offset = info().stream_offset;
  }
  if (!at.file)
  {
    check(tetlod_open_topology(&at.file, whole, number, &error), error);
    at.offset = info().stream_offset + info().topologies[number].offset;
  }
  if (!at.series)
  {
    const tetlod_status status = tetlod_series_new(&at.series, at.file, &error);
    if (status != TETLOD_ERR_ARGUMENT) // which says that there are no steps
      check(status, error);
  }
  step = at.series ? tetlod_step_for_time(tetlod_series_info(at.series), time) : 0;
  return at;
}

namespace
{
// Where errors are fractions of each step's own range (format/SPEC.md, 3.7). More than needed may only be finer.
bool own_ranges(const struct tetlod_info* in)
{
  const std::string text(in->metadata, in->metadata_size);
  const std::string key = "\"series_range\":";
  size_t at = text.find(key);
  at = at == std::string::npos ? at : text.find_first_not_of(' ', at + key.size());
  return at != std::string::npos && text.compare(at, 6, "\"step\"") == 0;
}

uint32_t band_within(const struct tetlod_series* series, uint32_t step, double limit, bool absolute, bool own)
{
  if (absolute)
    return tetlod_band_for_step_abs(series, step, limit);
  return own ? tetlod_band_for_error(tetlod_series_info(series), limit) : tetlod_band_for_step(series, step, limit);
}
}

uint32_t tetlod_stream::band_for(double time, const tetlod_choice& choice)
{
  uint32_t step = 0;
  part& at = part_of(time, step);
  const struct tetlod_series_info* steps = tetlod_series_info(at.series);
  const bool absolute = choice.abs_error >= 0;
  const double limit = absolute ? choice.abs_error : choice.error;
  const struct tetlod_info* in = tetlod_info(at.file);
  uint32_t band = band_within(at.series, step, limit, absolute, own_ranges(in));
  if (band == TETLOD_NONE && limit > 0)
    throw std::runtime_error("the steps have no error of at most " +
      (absolute ? std::to_string(limit) : percent(limit)) + "; the finest is " +
      percent(steps->bands[steps->band_count - 1].error));
  band = band == TETLOD_NONE ? steps->band_count - 1 : band;
  if (choice.level >= 0)
    for (band = steps->band_count - 1; band > 0 && steps->bands[band].level > static_cast<uint32_t>(choice.level);)
      band--;
  while (choice.level < 0 && band > 0 && choice.tets && in->levels[steps->bands[band].level].tets > choice.tets)
    band--;
  while (choice.level < 0 && band > 0 && choice.bytes && in->levels[steps->bands[band].level].end > choice.bytes)
    band--;
  return band;
}

uint32_t tetlod_stream::coarse_band(double time, uint64_t tets)
{
  uint32_t step = 0;
  part& at = part_of(time, step);
  const struct tetlod_series_info* steps = tetlod_series_info(at.series);
  uint32_t band = steps->band_count - 1;
  while (band > 0 && tetlod_info(at.file)->levels[steps->bands[band].level].tets > tets)
    band--;
  return band;
}

// ---- moving

// The bytes come in as few requests as they need: those of a level, or of some of the pages and what is before them.
void tetlod_stream::fetch(
  const part& at, const std::vector<uint32_t>& fields, uint32_t level, const tetlod_page_set* pages)
{
  static const uint32_t none = 0;
  const uint32_t* numbers = fields.empty() ? &none : fields.data();
  const uint32_t count = static_cast<uint32_t>(fields.size());
  level = pages ? tetlod_info(at.file)->first_paged_level - 1 : level;
  std::vector<tetlod_span> spans(tetlod_spans(at.file, TETLOD_NONE, level, numbers, count, nullptr, 0));
  tetlod_spans(at.file, TETLOD_NONE, level, numbers, count, spans.data(), spans.size());
  if (pages)
  {
    const size_t before = spans.size();
    spans.resize(before + tetlod_page_set_spans(pages, numbers, count, GAP, nullptr, 0));
    tetlod_page_set_spans(pages, numbers, count, GAP, spans.data() + before, spans.size() - before);
  }
  for (const tetlod_span& span : spans)
    expect(at.offset + span.offset, span.size);
}

// A cursor begins at the coarsest level.
void tetlod_stream::make_cursor(part& at, const std::vector<uint32_t>& fields, const tetlod_page_set* pages)
{
  tetlod_error error = {};
  static const uint32_t none = 0;
  if (!at.cursor)
  {
    check(tetlod_cursor_new(&at.cursor, at.file, fields.empty() ? &none : fields.data(),
            static_cast<uint32_t>(fields.size()), &error),
      error);
    at.decoded.assign(tetlod_info(at.file)->field_count, false);
    for (uint32_t field : fields)
      at.decoded[field] = true;
  }
  if (pages || at.some_pages)
    check(tetlod_cursor_select(at.cursor, pages, &error), error);
  at.some_pages = pages != nullptr;
  for (uint32_t field : fields)
    if (!at.decoded[field])
    {
      check(tetlod_cursor_add_field(at.cursor, field, &error), error);
      at.decoded[field] = true;
    }
}

void tetlod_stream::move(
  part& at, uint32_t level, const std::vector<uint32_t>& fields, const tetlod_page_set* pages)
{
  tetlod_error error = {};
  struct tetlod_mesh mesh = {};
  struct tetlod_page_set_info set = {};
  fetch(at, fields, level, pages);
  make_cursor(at, fields, pages);
  if (pages)
    tetlod_page_set_info(pages, &set);
  tetlod_cursor_mesh(at.cursor, &mesh);
  const double from = mesh.tets;
  const double to = static_cast<double>(pages ? set.tets : tetlod_info(at.file)->levels[level].tets);
  for (tetlod_status status = TETLOD_MORE; status == TETLOD_MORE;)
  {
    status = tetlod_cursor_step(at.cursor, level, RECORDS, &error);
    if (status != TETLOD_MORE)
      check(status, error);
    tetlod_cursor_mesh(at.cursor, &mesh);
    if (status == TETLOD_MORE && progress(from == to ? 0 : (mesh.tets - from) / (to - from)))
      throw tetlod_cancelled();
  }
}

// ---- what a level holds

std::vector<uint32_t> tetlod_stream::numbers_of(const names& fields) const
{
  std::vector<uint32_t> numbers;
  for (uint32_t f = 0; f < info().field_count; f++)
    if (has(fields, info().fields[f].name))
      numbers.push_back(f);
  return numbers;
}

// What the cursor has; the facts are those of `number`.
tetlod_view tetlod_stream::view_of(part& at, uint32_t number, const std::vector<uint32_t>& fields) const
{
  const struct tetlod_info& in = info();
  struct tetlod_mesh mesh = {};
  tetlod_cursor_mesh(at.cursor, &mesh);
  tetlod_view view = { mesh.vertices, mesh.tets, in.position_type, mesh.positions, mesh.corners, {}, {}, {}, in.cid };
  view.facts = { { "tetlod_level", number }, { "tetlod_domain_error", in.levels[number].domain_error } };
  for (uint32_t f : fields)
  {
    const struct tetlod_field& field = in.fields[f];
    view.fields.push_back(
      { field.name, static_cast<int>(field.components), vtk_type(field.type), mesh.fields[f] });
    add_fact(view, field.name, in.levels[number].errors[f * TETLOD_MEASURES + TETLOD_MAX]);
  }
  return view;
}

tetlod_view tetlod_stream::level(uint32_t number, const names& fields, const names& cells)
{
  part& at = parts[0];
  const std::vector<uint32_t> numbers = numbers_of(fields);
  move(at, number, numbers);
  tetlod_view view = view_of(at, number, numbers);
  add_cells(at, cells, view, -1);
  return view;
}

// ---- finer in a box

// The tail has no pages.
uint32_t tetlod_stream::finest_region() const
{
  return info().level_count - 1 - (info().exact_last ? 1 : 0);
}

bool tetlod_stream::has_region(uint32_t& coarse, uint32_t fine) const
{
  if (info().page_count == 0 || fine < info().first_paged_level || fine > finest_region() || fine <= coarse)
    return false;
  coarse = std::max(coarse, info().first_paged_level - 1);
  return true;
}

tetlod_view tetlod_stream::region(
  uint32_t coarse, uint32_t fine, const double* box, const names& fields, const names& cells)
{
  part& at = parts[0];
  const tetlod_place place = { { box[0], box[2], box[4] }, { box[1], box[3], box[5] }, 0, fine };
  const std::vector<uint32_t> numbers = numbers_of(fields);
  tetlod_page_set* set = nullptr;
  tetlod_error error = {};
  const tetlod_status status = tetlod_page_set_new(&set, at.file, coarse, &place, 1, &error);
  const std::unique_ptr<tetlod_page_set, decltype(&tetlod_page_set_free)> pages(set, tetlod_page_set_free);
  struct tetlod_page_set_info about = {};
  check(status, error);
  tetlod_page_set_info(set, &about);
  move(at, about.level, numbers, set);
  tetlod_view view = view_of(at, coarse, numbers);
  names others = cells;
  others.erase(std::remove(others.begin(), others.end(), PARTS), others.end());
  add_cells(at, others, view, -1);
  add_parts(at, coarse, fine, view);
  return view;
}

// Values of cells are there for all tetrahedra of the stream: the view has some of them.
void tetlod_stream::add_parts(part& at, uint32_t coarse, uint32_t fine, tetlod_view& view)
{
  std::vector<uint32_t> rows(view.tets), levels(view.tets);
  tetlod_cursor_numbers(at.cursor, nullptr, rows.data());
  tetlod_cursor_tet_levels(at.cursor, levels.data());
  at.chosen.clear();
  for (tetlod_column& column : view.cells)
  {
    const size_t width = static_cast<size_t>(column.components);
    std::vector<double>& values = at.chosen[column.name];
    for (uint32_t row : rows)
      values.insert(values.end(), column.values + row * width, column.values + (row + 1) * width);
    column.values = values.data();
  }
  std::vector<double>& marks = at.chosen[PARTS];
  for (uint32_t level : levels)
    marks.push_back(level >= fine ? 1 : level <= coarse ? 0 : 2);
  view.cells.push_back({ PARTS, 1, VTK_UNSIGNED_CHAR, marks.data() });
}

// ---- what a step holds

void tetlod_stream::read_series(part& at, uint32_t band, uint32_t step, const names& fields)
{
  const struct tetlod_series_info* steps = tetlod_series_info(at.series);
  std::vector<uint32_t> numbers;
  tetlod_error error = {};
  for (uint32_t f = 0; f < steps->field_count; f++)
    if (has(fields, tetlod_info(at.file)->fields[steps->fields[f]].name) || f == steps->displacement)
    {
      const tetlod_span span = tetlod_step_span(at.series, f, band, step);
      numbers.push_back(f);
      expect(at.offset + span.offset, span.size);
    }
  static const uint32_t none = 0;
  tetlod_series_select(at.series, numbers.empty() ? &none : numbers.data(), static_cast<uint32_t>(numbers.size()));
  check(tetlod_seek_step(at.series, at.cursor, band, step, &error), error);
}

tetlod_view tetlod_stream::step(double time, uint32_t band, const names& fields, const names& cells)
{
  uint32_t step = 0;
  part& at = part_of(time, step);
  const struct tetlod_info* in = tetlod_info(at.file);
  const struct tetlod_series_info* steps = tetlod_series_info(at.series);
  const uint32_t number = steps->bands[band].level;
  struct tetlod_mesh mesh = {};
  tetlod_error error = {};
  move(at, number, {});
  read_series(at, band, step, fields);
  tetlod_cursor_mesh(at.cursor, &mesh);
  tetlod_view view = { mesh.vertices, mesh.tets, in->position_type, mesh.positions, mesh.corners, {}, {}, {}, in->cid };
  if (steps->displacement != TETLOD_NONE)
  {
    at.moved.assign(mesh.positions, mesh.positions + 3 * static_cast<size_t>(mesh.vertices));
    check(tetlod_step_move(at.series, at.moved.data(), &error), error);
    view.positions = at.moved.data();
  }
  view.facts = { { "tetlod_level", number }, { "tetlod_domain_error", in->levels[number].domain_error },
    { "TimeValue", steps->times[step] } };
  for (uint32_t f = 0; f < steps->field_count; f++)
  {
    const struct tetlod_field& field = in->fields[steps->fields[f]];
    if (!has(fields, field.name))
      continue;
    view.fields.push_back({ field.name, static_cast<int>(field.components), vtk_type(steps->types[f]),
      tetlod_step_values(at.series, f) });
    add_fact(view, field.name, tetlod_step_error(at.series, f, band, step));
  }
  add_cells(at, cells, view, step);
  return view;
}

// Values of tetrahedra lie behind the levels. Those of a file that is cut off are left out where bytes are missing.
void tetlod_stream::add_cells(part& at, const names& wanted, tetlod_view& view, int64_t step)
{
  const struct tetlod_info* in = tetlod_info(at.file);
  for (uint32_t f = 0; f < in->cell_field_count; f++)
  {
    const struct tetlod_cell_field& field = in->cell_fields[f];
    tetlod_error error = {};
    tetlod_status status = TETLOD_OK;
    if (!has(wanted, field.name) || (step >= 0 && !tetlod_has_step_cells(at.series, f, static_cast<uint32_t>(step))))
      continue;
    std::vector<double>& values = at.cells[field.name];
    const bool held = step < 0 && !values.empty();
    values.resize(static_cast<size_t>(field.components) * in->tets);
    if (!held && step < 0)
      status = tetlod_cells(at.file, f, values.data(), &error);
    else if (!held)
      status = tetlod_step_cells(at.series, f, static_cast<uint32_t>(step), values.data(), &error);
    if (status != TETLOD_OK)
      at.cells.erase(field.name);
    if (status == TETLOD_ERR_TRUNCATED)
      continue;
    check(status, error);
    view.cells.push_back({ field.name, static_cast<int>(field.components), vtk_type(field.type), values.data() });
  }
}
