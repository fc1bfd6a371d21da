/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * The base mesh grows across faces (SPEC 9.1): tetrahedra are visited in order of arrival, and for each face that has a
 * tetrahedron on one side only it is said whether there is another and which vertex that has. What cannot be reached
 * starts anew with four vertices, so that any list of tetrahedra can be written.
 */
#include "format/coding/base.h"

#include <string.h>

#include "format/coding/record.h"
#include "format/fail.h"

/* Faces by their vertices in ascending order. `tet` chains all tetrahedra of the face in an encoder (4 * tet +
 * face). */
struct face_table {
    uint32_t *keys; /* [3 * size] */
    uint32_t *sides; /* tetrahedra that have arrived; 0 with `chain` NONE: a free place */
    uint32_t *chain;
    size_t keys_capacity, sides_capacity, chain_capacity, mask;
};

struct grower {
    struct tetlodi_recorder *recorder;
    struct tetlodi_memory *memory;
    const struct tetlodi_base_guide *guide;
    struct face_table faces;
    uint32_t vertices, tets; /* there are to be */
    uint32_t *next;          /* encoder: [4 * tets] the next in the face's chain */
    uint8_t *arrived;        /* encoder: [tets] */
    size_t next_capacity, arrived_capacity;
};

/* Corners of face f of a tetrahedron, without orientation. */
static void face_key(const uint32_t *corners, unsigned face, uint32_t key[3])
{
    unsigned n = 0;
    for (unsigned c = 0; c < 4; c++)
        if (c != face)
            key[n++] = corners[c];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            if (key[j] > key[j + 1]) {
                uint32_t swap = key[j];
                key[j] = key[j + 1];
                key[j + 1] = swap;
            }
}

static size_t face_find(struct face_table *table, const uint32_t *corners, unsigned face)
{
    uint32_t key[3];
    face_key(corners, face, key);
    uint64_t hash = ((uint64_t)key[0] * UINT64_C(0x9e3779b97f4a7c15) + key[1]) * UINT64_C(0xc2b2ae3d27d4eb4f) + key[2];
    hash *= UINT64_C(0x9e3779b97f4a7c15);
    size_t at = (size_t)(hash >> 32) & table->mask;
    for (; table->sides[at] || table->chain[at] != TETLOD_NONE; at = (at + 1) & table->mask)
        if (memcmp(table->keys + 3 * at, key, sizeof key) == 0)
            return at;
    memcpy(table->keys + 3 * at, key, sizeof key);
    return at;
}

static int table_init(struct grower *grower, struct face_table *table, uint32_t tets)
{
    size_t size = 16;
    while (size < 5 * (size_t)tets) // of four faces each: even if none were shared there are free places
        size *= 2;
    if (!TETLODI_ROOM(grower->memory, table->keys, table->keys_capacity, 3 * size) ||
        !TETLODI_ROOM(grower->memory, table->sides, table->sides_capacity, size) ||
        !TETLODI_ROOM(grower->memory, table->chain, table->chain_capacity, size))
        return 0;
    memset(table->sides, 0, size * sizeof *table->sides);
    memset(table->chain, 0xff, size * sizeof *table->chain);
    table->mask = size - 1;
    return 1;
}

/* All tetrahedra of the guide by face. The encoder's table has the guide's numbers, so it is one of its own. */
static int guide_init(struct grower *grower, struct face_table *table)
{
    const struct tetlodi_base_guide *guide = grower->guide;
    if (!table_init(grower, table, guide->tets) ||
        !TETLODI_ROOM(grower->memory, grower->next, grower->next_capacity, 4 * (size_t)guide->tets) ||
        !TETLODI_ROOM(grower->memory, grower->arrived, grower->arrived_capacity, guide->tets + (size_t)1))
        return 0;
    memset(grower->arrived, 0, guide->tets);
    memset(guide->arrival, 0xff, guide->vertices * sizeof *guide->arrival);
    for (size_t i = 4 * (size_t)guide->tets; i--;) {
        size_t at = face_find(table, guide->corners + i / 4 * 4, i % 4);
        grower->next[i] = table->chain[at];
        table->chain[at] = (uint32_t)i;
    }
    return 1;
}

/* The tetrahedron across a face: the corner is replaced and two others change places to keep the orientation. */
static void across(const uint32_t *corners, unsigned face, uint32_t vertex, uint32_t out[4])
{
    unsigned first = face == 0 ? 1 : 0, second = face <= 1 ? 2 : 1;
    memcpy(out, corners, 4 * sizeof *out);
    out[face] = vertex;
    out[first] = corners[second];
    out[second] = corners[first];
}

static int is_even_permutation(const uint32_t *a, const uint32_t *b)
{
    uint32_t c[4];
    int odd = 0;
    memcpy(c, b, sizeof c);
    for (int i = 0; i < 4; i++) {
        int j = i;
        while (j < 4 && c[j] != a[i])
            j++;
        if (j == 4)
            return 0;
        if (j != i) {
            uint32_t swap = c[i];
            c[i] = c[j];
            c[j] = swap;
            odd ^= 1;
        }
    }
    return !odd;
}

/* The encoder's answer: a tetrahedron that has not arrived across the face of arrived tetrahedron t, in the orientation
 * that the coding implies, or NONE. Its fourth vertex in the guide's numbers goes to *out_vertex. */
static uint32_t find_across(struct grower *grower, struct face_table *table, const uint32_t *corners, unsigned face,
                            uint32_t *out_vertex)
{
    const struct tetlodi_base_guide *guide = grower->guide;
    uint32_t old[4], wanted[4];
    for (int c = 0; c < 4; c++)
        old[c] = guide->vertex_order[corners[c]];
    for (uint32_t i = table->chain[face_find(table, old, face)]; i != TETLOD_NONE; i = grower->next[i]) {
        const uint32_t *other = guide->corners + i / 4 * 4;
        across(old, face, other[i % 4], wanted);
        if (!grower->arrived[i / 4] && is_even_permutation(wanted, other)) {
            *out_vertex = other[i % 4];
            return i / 4;
        }
    }
    return TETLOD_NONE;
}

/* A vertex: the next to arrive, or one that is there. `old` is the encoder's. */
static uint32_t code_vertex(struct grower *grower, uint32_t old)
{
    struct tetlodi_recorder *recorder = grower->recorder;
    struct tetlodi_replay *replay = recorder->replay;
    const struct tetlodi_base_guide *guide = grower->guide;
    uint32_t count = replay->vertices;
    int fresh = guide && guide->arrival[old] == TETLOD_NONE;
    fresh = code_bit(recorder->coders, &recorder->models->fresh, fresh);
    if (fresh) {
        if (count == grower->vertices) {
            recorder->coders->bad = 1;
            return 0;
        }
        if (guide) {
            guide->arrival[old] = count;
            guide->vertex_order[count] = old;
        }
        return replay->vertices++;
    }
    int64_t back = guide ? (int64_t)count - 1 - guide->arrival[old] : 0;
    back = code_number(recorder->coders, &recorder->models->vertex, 0, back);
    if (back < 0 || back >= count) {
        recorder->coders->bad = 1;
        return 0;
    }
    return count - 1 - (uint32_t)back;
}

static enum tetlod_status arrive(struct grower *grower, const uint32_t *corners, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = grower->recorder->replay;
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++)
            if (corners[i] == corners[j])
                grower->recorder->coders->bad = 1;
    if (grower->recorder->coders->bad)
        return tetlodi_fail(error, TETLOD_ERR_STREAM, "the base mesh is not one");
    if (!TETLODI_ROOM(grower->memory, replay->corners, replay->corners_capacity, 4 * (size_t)replay->tets + 4))
        return tetlodi_no_room(grower->memory, error);
    memcpy(replay->corners + 4 * (size_t)replay->tets++, corners, 4 * sizeof *corners);
    for (unsigned f = 0; f < 4; f++)
        grower->faces.sides[face_find(&grower->faces, corners, f)]++;
    return TETLOD_OK;
}

/* A tetrahedron by its four vertices: the encoder's first that has not arrived. */
static enum tetlod_status code_seed(struct grower *grower, uint32_t *scan, struct tetlod_error *error)
{
    const struct tetlodi_base_guide *guide = grower->guide;
    uint32_t corners[4];
    while (guide && grower->arrived[*scan])
        ++*scan;
    for (int c = 0; c < 4; c++)
        corners[c] = code_vertex(grower, guide ? guide->corners[4 * (size_t)*scan + (size_t)c] : 0);
    if (guide) {
        grower->arrived[*scan] = 1;
        guide->tet_order[grower->recorder->replay->tets] = *scan;
    }
    return arrive(grower, corners, error);
}

static enum tetlod_status grow(struct grower *grower, struct face_table *guide_faces, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = grower->recorder->replay;
    struct tetlodi_coder *coder = grower->recorder->coders;
    uint32_t scan = 0;
    for (size_t side = 0; replay->tets < grower->tets; side++) {
        uint32_t old = 0, next[4], found = TETLOD_NONE;
        if (side == 4 * (size_t)replay->tets) {
            TETLOD_TRY(code_seed(grower, &scan, error));
            side--;
            continue;
        }
        uint32_t corners[4];
        memcpy(corners, replay->corners + side / 4 * 4, sizeof corners);
        unsigned face = side % 4;
        if (grower->faces.sides[face_find(&grower->faces, corners, face)] > 1)
            continue;
        if (grower->guide)
            found = find_across(grower, guide_faces, corners, face, &old);
        if (!code_bit(coder, &grower->recorder->models->across[face > 0], found != TETLOD_NONE))
            continue;
        if (grower->guide) {
            grower->arrived[found] = 1;
            grower->guide->tet_order[replay->tets] = found;
        }
        across(corners, face, code_vertex(grower, old), next);
        TETLOD_TRY(arrive(grower, next, error));
    }
    return TETLOD_OK;
}

/* Vertices that no tetrahedron of the base mesh uses come last, in the guide's order. */
static void lone_vertices(const struct tetlodi_replay *replay, const struct tetlodi_base_guide *guide)
{
    uint32_t count = replay->vertices;
    for (uint32_t old = 0; old < guide->vertices; old++)
        if (guide->arrival[old] == TETLOD_NONE) {
            guide->arrival[old] = count;
            guide->vertex_order[count++] = old;
        }
}

static void table_fini(struct grower *grower, struct face_table *table)
{
    TETLODI_FREE(grower->memory, table->keys, table->keys_capacity);
    TETLODI_FREE(grower->memory, table->sides, table->sides_capacity);
    TETLODI_FREE(grower->memory, table->chain, table->chain_capacity);
}

enum tetlod_status tetlodi_base_connectivity(struct tetlodi_recorder *recorder, uint32_t vertices, uint32_t tets,
                                             const struct tetlodi_base_guide *guide, struct tetlod_error *error)
{
    struct tetlodi_replay *replay = recorder->replay;
    struct grower grower = {.recorder = recorder, .memory = replay->memory, .guide = guide, .vertices = vertices,
                            .tets = tets};
    struct face_table guide_faces = {0};
    enum tetlod_status status;
    tetlodi_models_start(recorder);
    replay->vertices = replay->tets = 0;
    if (!table_init(&grower, &grower.faces, tets) || (guide && !guide_init(&grower, &guide_faces)))
        status = tetlodi_no_room(replay->memory, error);
    else
        status = grow(&grower, &guide_faces, error);
    if (status == TETLOD_OK && guide)
        lone_vertices(replay, guide);
    replay->vertices = vertices;
    table_fini(&grower, &grower.faces);
    table_fini(&grower, &guide_faces);
    TETLODI_FREE(replay->memory, grower.next, grower.next_capacity);
    TETLODI_FREE(replay->memory, grower.arrived, grower.arrived_capacity);
    return status;
}

/* SPEC 9.2: a vertex is predicted in the middle of those corners of its first tetrahedron that are known. */
static int64_t predict(const struct tetlodi_column *column, unsigned axis, unsigned component, const uint32_t *corners,
                       uint32_t known, unsigned *out_context)
{
    size_t n = column->components;
    double sum = 0;
    uint64_t most = 0;
    int64_t first = 0;
    unsigned count = 0;
    for (int c = 0; c < 4; c++) {
        if (corners[c] >= known)
            continue;
        int64_t code = column->codes[corners[c] * n + component];
        sum = sum + column->values[corners[c] * n + component];
        first = count++ ? first : code;
        uint64_t distance = code_distance(code, first);
        most = distance > most ? distance : most;
    }
    *out_context = count < 2 ? NUMBER_CONTEXTS - 1 : bit_length(most);
    if (!count)
        return 0;
    double value = sum / (double)count;
    return isfinite(value) ? scale_code(&column->scale, axis, value) : first;
}

static int code_base_vertex(struct tetlodi_column *column, struct tetlodi_coder *coder, struct tetlodi_number *models,
                            const uint8_t *copied, uint32_t vertex, const uint32_t *corners)
{
    size_t n = column->components;
    unsigned width = scale_width(&column->scale);
    for (unsigned c = 0; c < n; c++) {
        unsigned axis = copied ? 0 : c, context;
        int64_t *code = &column->codes[vertex * n + c];
        if (copied && copied[c] < c) {
            *code = column->codes[vertex * n + copied[c]];
            column->values[vertex * n + c] = column->values[vertex * n + copied[c]];
            continue;
        }
        int64_t base = predict(column, axis, c, corners, vertex, &context);
        // a decoder's code is not there yet
        int64_t difference = encoder_of(coder) ? code_difference(*code, base, width) : 0;
        difference = code_number(coder, &models[axis], context, difference);
        *code = code_offset(base, difference, &column->scale);
        double value = scale_value(&column->scale, axis, *code);
        if (coder->bad || !isfinite(value))
            return 0;
        column->values[vertex * n + c] = value;
    }
    return 1;
}

enum tetlod_status tetlodi_base_column(struct tetlodi_replay *replay, struct tetlodi_column *column,
                                       struct tetlodi_coder *coder, struct tetlodi_number *models,
                                       const uint8_t *copied, struct tetlod_error *error)
{
    static const uint32_t nobody[4] = {TETLOD_NONE, TETLOD_NONE, TETLOD_NONE, TETLOD_NONE};
    uint32_t known = 0;
    int good = 1;
    for (size_t i = 0; i < 4 * (size_t)replay->tets && good; i++)
        if (replay->corners[i] == known)
            good = code_base_vertex(column, coder, models, copied, known++, replay->corners + i / 4 * 4);
    while (good && known < replay->vertices)
        good = code_base_vertex(column, coder, models, copied, known++, nobody);
    return good ? TETLOD_OK : tetlodi_fail(error, TETLOD_ERR_STREAM, "the base mesh holds a value that is not finite");
}
