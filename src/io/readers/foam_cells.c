/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The cells of an OpenFOAM mesh, whose files list faces and the cells on their two sides. Most meshes that matter here
 * are of tetrahedra, which take less memory than their faces: a cell of four triangles is put together while the faces
 * go by. Only the faces of other cells are kept. These are recognised by their faces: hexahedra, wedges and pyramids
 * become these, all others polyhedra.
 */
#include "src/io/readers/foam_cells.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"

/* A cell of four faces has a bit for each of its points that one of the faces seen so far leaves out. The base, which
 * comes first, leaves out the last one. */
enum { SEEN_NONE = 0, SEEN_BASE = 8, SEEN_ALL = 15, NO_TET = 16 };

struct faces {
    const struct io_input *input;
    struct tetlod_error *error;
    uint64_t all, cells;         /* faces and cells of the mesh */
    uint32_t *face_counts;       /* owned: of each cell */
    uint8_t *seen;               /* owned: by cell */
    uint32_t *tets;              /* owned, 4 * cells; NULL: no cell has four faces */
    /* Faces that are kept: */
    uint64_t count;
    uint64_t *offsets;           /* owned, count + 1 */
    uint32_t *corners;           /* owned */
    uint32_t *owner, *neighbour; /* owned: cells, or TETLOD_NONE for those that are not kept for */
    size_t offset_capacity, corner_capacity, owner_capacity, neighbour_capacity;
    uint64_t *cell_offsets;      /* owned, cells + 2 */
    uint32_t *cell_faces;        /* owned: kept faces of each cell */
};

/* ---- how many faces a cell has */

static enum tetlod_status count_cell(struct faces *f, struct foam_file *file, uint32_t cell, size_t *capacity)
{
    if (cell == TETLOD_NONE || cell >= 2 * f->all + 1)
        return foam_fail(file, "a face belongs to a cell that cannot be there");
    if (!ARRAY_RESERVE(f->face_counts, *capacity, (size_t)cell + 1))
        return tetlodi_fail_nomem(f->error, "the cells", (uint64_t)cell * sizeof *f->face_counts);
    while (f->cells <= cell)
        f->face_counts[f->cells++] = 0;
    f->face_counts[cell]++;
    return TETLOD_OK;
}

static enum tetlod_status count_file(struct faces *f, const char *name, size_t *capacity, uint64_t *count)
{
    struct foam_file file;
    struct foam_list list = {0};
    enum tetlod_status status = foam_open(&file, f->input, name, f->error);
    if (status == TETLOD_OK)
        status = foam_list_begin(&list, &file);
    f->all = f->all ? f->all : list.count;
    for (uint64_t i = 0; status == TETLOD_OK && i < list.count; i++) {
        status = foam_list_next(&list);
        if (status == TETLOD_OK)
            status = count_cell(f, &file, list.value, capacity);
    }
    if (status == TETLOD_OK)
        status = foam_list_end(&list);
    if (status == TETLOD_OK)
        status = foam_end(&file);
    foam_close(&file);
    *count = list.count;
    return status;
}

static enum tetlod_status count_faces(struct faces *f)
{
    uint64_t owners, neighbours;
    size_t capacity = 0;
    TETLOD_TRY(count_file(f, "constant/polyMesh/owner", &capacity, &owners));
    TETLOD_TRY(count_file(f, "constant/polyMesh/neighbour", &capacity, &neighbours));
    if (neighbours > owners)
        return tetlodi_fail(f->error, TETLOD_ERR_MESH,
                            "constant/polyMesh: there are %llu neighbours, but only %llu owners",
                            (unsigned long long)neighbours, (unsigned long long)owners);
    bool has_tets = false;
    for (uint64_t c = 0; c < f->cells && !has_tets; c++)
        has_tets = f->face_counts[c] == 4;
    f->seen = array_zero((size_t)f->cells, 1);
    f->tets = has_tets ? array_new((size_t)f->cells, 4 * sizeof *f->tets) : NULL;
    return f->seen && (f->tets || !has_tets) ? TETLOD_OK : tetlodi_fail_nomem(f->error, "the cells", f->cells * 17);
}

/* ---- faces as they go by */

struct face_reader {
    struct foam_file file, owner_file, neighbour_file;
    struct foam_list list, owners, neighbours; /* list: of a compact list the points of all faces */
    bool is_compact;
    uint64_t count, at;
    uint32_t *ends;    /* owned: of a compact list, where each face begins and ends */
    uint32_t *corners; /* owned: of the last face */
    size_t capacity;
    uint64_t sides;
    uint32_t owner, neighbour; /* TETLOD_NONE: it is on the boundary */
};

static void reader_close(struct face_reader *reader)
{
    foam_close(&reader->file);
    foam_close(&reader->owner_file);
    foam_close(&reader->neighbour_file);
    free(reader->ends);
    free(reader->corners);
}

/* Binary: where each face begins, then the points of all. */
static enum tetlod_status open_compact(struct face_reader *reader)
{
    uint64_t ends;
    TETLOD_TRY(foam_labels(&reader->file, &reader->ends, &ends));
    TETLOD_TRY(foam_list_begin(&reader->list, &reader->file));
    reader->count = ends ? ends - 1 : 0;
    bool good = ends > 0 && reader->ends[0] == 0;
    for (uint64_t i = 0; good && i < reader->count; i++)
        good = reader->ends[i] <= reader->ends[i + 1];
    return good && reader->ends[reader->count] <= reader->list.count ? TETLOD_OK
                                                                     : foam_fail(&reader->file, "its faces do not fit");
}

/* To be closed also after a failure. */
static enum tetlod_status reader_open(struct face_reader *reader, const struct faces *f)
{
    *reader = (struct face_reader){0};
    TETLOD_TRY(foam_open(&reader->file, f->input, "constant/polyMesh/faces", f->error));
    TETLOD_TRY(foam_open(&reader->owner_file, f->input, "constant/polyMesh/owner", f->error));
    TETLOD_TRY(foam_open(&reader->neighbour_file, f->input, "constant/polyMesh/neighbour", f->error));
    TETLOD_TRY(foam_list_begin(&reader->owners, &reader->owner_file));
    TETLOD_TRY(foam_list_begin(&reader->neighbours, &reader->neighbour_file));
    reader->is_compact = strcmp(reader->file.class_name, "faceCompactList") == 0;
    if (reader->is_compact)
        TETLOD_TRY(open_compact(reader));
    else {
        TETLOD_TRY(foam_list_of_lists(&reader->list, &reader->file));
        reader->count = reader->list.count;
    }
    if (reader->count == reader->owners.count)
        return TETLOD_OK;
    return tetlodi_fail(f->error, TETLOD_ERR_MESH, "constant/polyMesh: there are %llu faces, but %llu owners",
                        (unsigned long long)reader->count, (unsigned long long)reader->owners.count);
}

/* Reads the next face, which is there, and its cells. */
static enum tetlod_status reader_next(struct face_reader *reader, struct tetlod_error *error)
{
    struct foam_list face, *list = reader->is_compact ? &reader->list : &face;
    uint64_t at = reader->at++;
    TETLOD_TRY(foam_list_next(&reader->owners));
    reader->owner = reader->owners.value;
    reader->neighbour = TETLOD_NONE;
    if (at < reader->neighbours.count) {
        TETLOD_TRY(foam_list_next(&reader->neighbours));
        reader->neighbour = reader->neighbours.value;
    }
    if (!reader->is_compact)
        TETLOD_TRY(foam_list_begin(&face, &reader->file));
    reader->sides = reader->is_compact ? reader->ends[at + 1] - reader->ends[at] : face.count;
    if (!ARRAY_RESERVE(reader->corners, reader->capacity, (size_t)reader->sides))
        return tetlodi_fail_nomem(error, "a face", reader->sides * sizeof *reader->corners);
    for (uint64_t i = 0; i < reader->sides; i++) {
        TETLOD_TRY(foam_list_next(list));
        reader->corners[i] = list->value;
    }
    return reader->is_compact ? TETLOD_OK : foam_list_end(&face);
}

/* Whether the files end as they should. */
static enum tetlod_status reader_end(struct face_reader *reader)
{
    for (uint64_t i = reader->is_compact ? reader->ends[reader->count] : reader->count; i < reader->list.count; i++)
        TETLOD_TRY(foam_list_next(&reader->list));
    TETLOD_TRY(foam_list_end(&reader->list));
    return foam_end(&reader->file);
}

/* ---- tetrahedra */

static bool may_be_tet(const struct faces *f, uint32_t cell)
{
    return f->face_counts[cell] == 4 && f->seen[cell] != NO_TET;
}

/* The first face becomes the base, its points turned as seen from inside: faces are counter-clockwise seen from outside
 * their owner. */
static void start_tet(struct faces *f, uint32_t cell, const uint32_t *corners, bool is_owner)
{
    uint32_t *tet = f->tets + 4 * (size_t)cell;
    for (int i = 0; i < 3; i++)
        tet[i] = corners[is_owner ? 2 - i : i];
    bool is_triangle = tet[0] != tet[1] && tet[1] != tet[2] && tet[0] != tet[2];
    f->seen[cell] = is_triangle ? SEEN_BASE : NO_TET;
}

static bool is_among(uint32_t corner, const uint32_t *corners, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (corners[i] == corner)
            return true;
    return false;
}

/* Each further face has the point above the base, and leaves out another one. */
static void extend_tet(struct faces *f, uint32_t cell, const uint32_t *corners)
{
    uint32_t *tet = f->tets + 4 * (size_t)cell;
    uint8_t left_out = 0, count = 0;
    for (int i = 0; i < 3 && f->seen[cell] == SEEN_BASE; i++)
        if (!is_among(corners[i], tet, 3))
            tet[3] = corners[i];
    bool is_new = f->seen[cell] != SEEN_BASE || !is_among(tet[3], tet, 3);
    for (uint8_t i = 0; i < 4; i++)
        if (!is_among(tet[i], corners, 3)) {
            left_out = (uint8_t)(1u << i);
            count++;
        }
    bool fits = is_new && count == 1 && !(f->seen[cell] & left_out);
    f->seen[cell] = fits ? f->seen[cell] | left_out : NO_TET;
}

static void add_to_tet(struct faces *f, uint32_t cell, const struct face_reader *reader)
{
    if (reader->sides != 3)
        f->seen[cell] = NO_TET;
    else if (f->seen[cell] == SEEN_NONE)
        start_tet(f, cell, reader->corners, cell == reader->owner);
    else
        extend_tet(f, cell, reader->corners);
}

/* ---- faces of other cells */

static enum tetlod_status keep_face(struct faces *f, const struct face_reader *reader)
{
    uint64_t begin = f->count ? f->offsets[f->count] : 0, end = begin + reader->sides;
    size_t count = (size_t)f->count + 1;
    if (!ARRAY_RESERVE(f->offsets, f->offset_capacity, count + 1) ||
        !ARRAY_RESERVE(f->corners, f->corner_capacity, (size_t)end) ||
        !ARRAY_RESERVE(f->owner, f->owner_capacity, count) ||
        !ARRAY_RESERVE(f->neighbour, f->neighbour_capacity, count))
        return tetlodi_fail_nomem(f->error, "the faces", end * sizeof *f->corners + count * 16);
    f->offsets[count - 1] = begin;
    f->offsets[count] = end;
    if (reader->sides) // of none there may be no array yet
        memcpy(f->corners + begin, reader->corners, (size_t)reader->sides * sizeof *f->corners);
    f->owner[count - 1] = reader->owner;
    f->neighbour[count - 1] = reader->neighbour;
    f->count = count;
    return TETLOD_OK;
}

/* One pass over all faces. Again: the tetrahedra are there already. */
static enum tetlod_status pass_faces(struct faces *f, bool again)
{
    struct face_reader reader;
    enum tetlod_status status = reader_open(&reader, f);
    f->count = 0;
    for (uint64_t face = 0; face < reader.count && status == TETLOD_OK; face++) {
        TETLOD_TRY_DONE(reader_next(&reader, f->error));
        const uint32_t cells[2] = {reader.owner, reader.neighbour};
        bool is_kept = false;
        for (int i = 0; i < 2; i++) {
            if (cells[i] == TETLOD_NONE)
                continue;
            if (cells[i] >= f->cells) // the file is being written
                TETLOD_TRY_DONE(foam_fail(&reader.owner_file, "it is another one than before"));
            if (!may_be_tet(f, cells[i]))
                is_kept = true;
            else if (!again)
                add_to_tet(f, cells[i], &reader);
        }
        if (is_kept)
            status = keep_face(f, &reader);
    }
    if (status == TETLOD_OK)
        status = reader_end(&reader);
done:
    reader_close(&reader);
    return status;
}

/* Cells of four faces that are no tetrahedra; how many there are. */
static uint64_t mark_others(struct faces *f)
{
    uint64_t count = 0;
    for (uint64_t c = 0; c < f->cells; c++)
        if (f->face_counts[c] == 4 && f->seen[c] != SEEN_ALL) {
            f->seen[c] = NO_TET;
            count++;
        }
    return count;
}

/* The kept faces of each cell, those that it owns first. */
static enum tetlod_status gather_faces(struct faces *f)
{
    uint64_t total = 0;
    f->cell_offsets = array_zero((size_t)f->cells + 2, sizeof *f->cell_offsets);
    for (uint64_t i = 0; f->cell_offsets && i < 2 * f->count; i++) {
        uint32_t cell = i < f->count ? f->owner[i] : f->neighbour[i - f->count];
        if (cell == TETLOD_NONE || may_be_tet(f, cell))
            continue;
        f->cell_offsets[cell + 2]++;
        total++;
    }
    f->cell_faces = array_new((size_t)total, sizeof *f->cell_faces);
    if (!f->cell_offsets || !f->cell_faces)
        return tetlodi_fail_nomem(f->error, "the cells", f->cells * 8 + total * 4);
    for (uint64_t c = 0; c < f->cells; c++)
        f->cell_offsets[c + 2] += f->cell_offsets[c + 1];
    for (uint64_t i = 0; i < 2 * f->count; i++) {
        uint32_t cell = i < f->count ? f->owner[i] : f->neighbour[i - f->count];
        if (cell != TETLOD_NONE && !may_be_tet(f, cell))
            f->cell_faces[f->cell_offsets[cell + 1]++] = (uint32_t)(i < f->count ? i : i - f->count);
    }
    free(f->neighbour);
    f->neighbour = NULL;
    return TETLOD_OK;
}

/* ---- cells by their faces */

static uint64_t sides_of(const struct faces *f, uint32_t face)
{
    return f->offsets[face + 1] - f->offsets[face];
}

/* The point that an edge of the cell joins to `point` outside the base face; -1 if there is none or several. */
static int64_t point_above(const struct faces *f, const uint32_t *faces, uint64_t count, uint32_t base, int64_t point)
{
    const uint32_t *bottom = f->corners + f->offsets[base];
    int64_t above = -1;
    for (uint64_t i = 0; i < count; i++) {
        const uint32_t *corners = f->corners + f->offsets[faces[i]];
        uint64_t sides = sides_of(f, faces[i]);
        for (uint64_t s = 0; s < sides && faces[i] != base; s++) {
            if (corners[s] != point)
                continue;
            const uint32_t ends[2] = {corners[(s + 1) % sides], corners[(s + sides - 1) % sides]};
            for (int e = 0; e < 2; e++) {
                if (is_among(ends[e], bottom, (size_t)sides_of(f, base)))
                    continue;
                if (above >= 0 && above != ends[e])
                    return -1;
                above = ends[e];
            }
        }
    }
    return above;
}

/* Cell c of these faces by shape: its corners in VTK's order; 0 if it is none of the four. A face's points are
 * counter-clockwise seen from outside its owner; the base's should be so from inside. */
static unsigned char find_shape(const struct faces *f, uint64_t c, const uint32_t *faces, uint64_t count,
                                int64_t corners[8], size_t *corner_count)
{
    unsigned triangles = 0, quads = 0;
    uint32_t base = faces[0];
    for (uint64_t i = 0; i < count; i++) {
        uint64_t sides = sides_of(f, faces[i]);
        triangles += sides == 3;
        quads += sides == 4;
        if (sides != 3 && sides != 4)
            return 0;
    }
    unsigned char type = triangles == 4 && quads == 0   ? VTK_TYPE_TET
                         : triangles == 0 && quads == 6 ? VTK_TYPE_HEXAHEDRON
                         : triangles == 2 && quads == 3 ? VTK_TYPE_WEDGE
                         : triangles == 4 && quads == 1 ? VTK_TYPE_PYRAMID
                                                        : 0;
    uint64_t sides = type == VTK_TYPE_TET || type == VTK_TYPE_WEDGE ? 3 : 4;
    for (uint64_t i = 0; i < count && sides_of(f, base) != sides; i++)
        base = faces[i];
    bool is_cone = type == VTK_TYPE_TET || type == VTK_TYPE_PYRAMID;
    for (uint64_t s = 0; s < sides && type; s++) {
        uint64_t side = f->owner[base] == c ? sides - 1 - s : s;
        corners[s] = f->corners[f->offsets[base] + side];
        int64_t above = point_above(f, faces, count, base, corners[s]);
        if (above < 0 || (is_cone && s && above != corners[sides]))
            return 0;
        corners[sides + (is_cone ? 0 : s)] = above;
    }
    *corner_count = (size_t)(is_cone ? sides + 1 : 2 * sides);
    for (size_t i = 0; i < *corner_count && type; i++)
        for (size_t j = 0; j < i; j++)
            if (corners[i] == corners[j])
                return 0;
    return type;
}

static enum tetlod_status add_polyhedron(struct faces *f, struct cells *cells, const uint32_t *faces, uint64_t count)
{
    size_t size = 1, at = 1;
    for (uint64_t i = 0; i < count; i++)
        size += 1 + (size_t)sides_of(f, faces[i]);
    int64_t *stream = array_new(size, sizeof *stream);
    if (!stream)
        return tetlodi_fail_nomem(f->error, "a polyhedron", size * 8);
    stream[0] = (int64_t)count;
    for (uint64_t i = 0; i < count; i++) {
        stream[at++] = (int64_t)sides_of(f, faces[i]);
        for (uint64_t c = f->offsets[faces[i]]; c < f->offsets[faces[i] + 1]; c++)
            stream[at++] = f->corners[c];
    }
    enum tetlod_status status = cells_add(cells, VTK_TYPE_POLYHEDRON, stream, size, f->error);
    free(stream);
    return status;
}

static enum tetlod_status add_other(struct faces *f, struct cells *cells, uint64_t c)
{
    const uint32_t *faces = f->cell_faces + f->cell_offsets[c];
    uint64_t count = f->cell_offsets[c + 1] - f->cell_offsets[c];
    int64_t corners[8];
    size_t corner_count;
    unsigned char type = count ? find_shape(f, c, faces, count, corners, &corner_count) : 0;
    return type ? cells_add(cells, type, corners, corner_count, f->error) : add_polyhedron(f, cells, faces, count);
}

static enum tetlod_status add_cells(struct faces *f, struct cells *cells)
{
    for (uint64_t c = 0; c < f->cells; c++)
        TETLOD_TRY(may_be_tet(f, (uint32_t)c) ? cells_add_numbers(cells, VTK_TYPE_TET, f->tets + 4 * c, 4, f->error)
                                              : add_other(f, cells, c));
    return TETLOD_OK;
}

/* Tetrahedra throughout are the cells as they are. */
static void take_tets(struct faces *f, struct cells *cells)
{
    *cells = (struct cells){.count = f->cells, .connectivity = f->tets, .connectivity_count = 4 * f->cells};
    f->tets = NULL;
}

static void faces_fini(struct faces *f)
{
    free(f->face_counts);
    free(f->seen);
    free(f->tets);
    free(f->offsets);
    free(f->corners);
    free(f->owner);
    free(f->neighbour);
    free(f->cell_offsets);
    free(f->cell_faces);
}

enum tetlod_status foam_cells(struct cells *out, const struct io_input *input, struct tetlod_error *error)
{
    struct faces f = {.input = input, .error = error};
    enum tetlod_status status;
    TETLOD_TRY_DONE(count_faces(&f));
    TETLOD_TRY_DONE(pass_faces(&f, false));
    if (mark_others(&f))
        TETLOD_TRY_DONE(pass_faces(&f, true));
    bool only_tets = f.tets && !f.count;
    for (uint64_t c = 0; c < f.cells && only_tets; c++)
        only_tets = may_be_tet(&f, (uint32_t)c);
    if (only_tets)
        take_tets(&f, out);
    else {
        TETLOD_TRY_DONE(gather_faces(&f));
        status = add_cells(&f, out);
    }
done:
    faces_fini(&f);
    return status;
}
