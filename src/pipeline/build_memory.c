/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/pipeline/build_memory.h"

#include "format/fail.h"
#include "src/measure/measure_levels.h"
#include "src/measure/overlay_levels.h"
#include "src/simplify/simplify.h"

/* What the writer takes a tetrahedron, a vertex and a component, without what it borrows; what of that is for records,
 * and goes before a field's exact tail, and what that takes; records that wait for other threads; and what the program
 * takes with its libraries and the compressor's tables: measured. What is built by cells takes PAGED_TET more a
 * tetrahedron: cells that wait, with their seams, and pages. Of the rest the allocator wastes one part in ALLOCATOR. */
enum { WRITER_TET = 27, WRITER_RECORDS = 36, WRITER_VERTEX = 40, WRITER_COMPONENT = 8, WRITER_TAIL = 9 << 18,
      WRITER_WAITING = 7 << 18, PAGED_TET = 40, PROGRAM = 14 << 20, ALLOCATOR = 32 };

/* What stays resident where large arrays are in files: a thread's cell, and the root, which has some cells' tetrahedra;
 * a tetrahedron of a cell: measured. The largest cell of a mesh has up to 2.6 times as many as it should. */
enum { CELL_TET = 300, ROOT_TET = 600, LARGEST_CELL_TET = 480 };

/* What a library that joins programs takes (OpenMPI: 20 MB, measured), and room to work: a mesh that takes little more
 * than that is not worth files. */
enum { SHARING = 128 << 20 };

static unsigned long long megabytes(uint64_t bytes)
{
    return (bytes >> 20) + 1;
}

static uint64_t component_count(const struct tetmesh *mesh)
{
    uint64_t count = 0;
    for (uint32_t f = 0; f < mesh->field_count; f++)
        count += mesh->fields[f].components;
    return count;
}

uint64_t build_bytes(const struct tetmesh *mesh, const struct build_options *options)
{
    const struct simplify_options simplify_options = {.metric = options->metric, .certify = options->certify,
                                                      .contract = options->contract, .threads = options->threads};
    uint64_t vertices = mesh->vertex_count, tets = mesh->tet_count, components = component_count(mesh);
    uint64_t held = vertices * (24 + 8 *
                                components) + tets * 16, bounds = options->local_bound ? options->control_count : 0;
    uint64_t contract = simplify_bytes(mesh, options->control_count, &simplify_options) + 8 * vertices * bounds;
    components += bounds; // a field more of each: in the log, where levels are measured, and in the stream
    uint64_t log = vertices * (40 + 8 * components);
    uint64_t measure = log + coarsening_bytes(mesh) + measure_levels_bytes(mesh) + bounds * (12 * vertices + 8 * tets) +
                       (build_asks_overlay(options) ? overlay_levels_bytes(mesh) : 0);
    uint64_t records = tets * WRITER_RECORDS, last = records > WRITER_TAIL ? records : WRITER_TAIL;
    uint64_t encode = log + tets * WRITER_TET + vertices * (WRITER_VERTEX + WRITER_COMPONENT * components) + last +
                      (options->threads == 1 ? 0 : WRITER_WAITING);
    uint64_t keep = options->keep_features > 0 ? log + coarsening_bytes(mesh) + 85 * vertices + 32 * tets : 0;
    uint64_t most = contract > measure ? contract : measure;
    most = most > keep ? most : keep;
    held += quantise_wanted(&options->quantise) ? held : 0; // the rounded mesh
    most = most > encode ? most : encode;
    uint64_t sum = held + most + (options->paged ? tets * PAGED_TET : 0);
    return PROGRAM + sum + sum / ALLOCATOR;
}

uint64_t build_spooled_bytes(const struct build_options *options)
{
    return PROGRAM + options->paged * (uint64_t)(CELL_TET * options->threads + ROOT_TET);
}

uint64_t build_share_bytes(const struct tetmesh *mesh, const struct build_options *options, uint32_t members)
{
    struct build_options whole = *options, cells = *options;
    whole.paged = 0;
    cells.paged = options->paged ? options->paged : BUILD_CELL_TETS;
    uint64_t least = SHARING + build_spooled_bytes(&cells);
    uint64_t share = mesh ? build_bytes(mesh, &whole) / members : 0;
    share += share / 2 + 2 * (uint64_t)LARGEST_CELL_TET * cells.paged;
    return share > least ? share : least;
}

enum tetlod_status build_fit_memory(const struct tetmesh *mesh, struct build_options *options,
                                    struct tetlod_error *error)
{
    uint64_t needed = build_bytes(mesh, options);
    const char *wrong = build_against_pages(options);
    if (!options->memory || needed <= options->memory)
        return TETLOD_OK;
    if (wrong)
        return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                            "it needs about %llu MB, more than --memory allows (%llu MB), and cannot be built by "
                            "cells: %s",
                            megabytes(needed), (unsigned long long)(options->memory >> 20), wrong);
    options->paged = options->paged ? options->paged : BUILD_CELL_TETS;
    options->spools = true;
    if (build_spooled_bytes(options) <= options->memory)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                        "it needs about %llu MB, more than --memory allows (%llu MB), by cells in files about %llu MB; "
                        "fewer --threads or smaller --paged cells need less",
                        megabytes(needed), (unsigned long long)(options->memory >> 20),
                        megabytes(build_spooled_bytes(options)));
}

enum tetlod_status build_check_memory(const struct tetmesh *mesh, const struct build_options *options,
                                      struct tetlod_error *error)
{
    uint64_t needed = build_bytes(mesh, options);
    if (!options->memory || options->spools || needed <= options->memory)
        return TETLOD_OK;
    return tetlodi_fail(error, TETLOD_ERR_LIMIT,
                        "it needs about %llu MB, more than --memory allows (%llu MB); carry fewer fields or raise it",
                        megabytes(needed), (unsigned long long)(options->memory >> 20));
}
