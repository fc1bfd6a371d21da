/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * usage: page_selections STREAM SEED COUNT [SHARE]
 *
 * COUNT random closed sets of pages of a lossless stream, each held against the stream's finest level: pages of boxes
 * and balls with a level each, pages at random, and an error for each page, that grows with its distance from a point.
 * One cursor goes from set to set. A line for each finding; exit status 1 if there is one. SHARE of the certified
 * errors is allowed, 1 unless it is given: with less there must be findings.
 *
 * - The mesh is the original with some vertices taken as one: a vertex that is not there is the one that it was split
 *   from. Each tetrahedron of the original with four corners then is there, no other one is. So there is no crack.
 * - Its topology and orientation are the original's; where the boundary keeps its place, volumes of regions too.
 * - What meets a box or ball by a corner has its level.
 * - In the tetrahedra of each level the largest difference over the overlay (oracle.h) is at most that level's `max`.
 *   Near a boundary that moves there is a partner within the level's domain error. So it is of all original vertices.
 */
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/tetlod.h"
#include "tests/attack/oracle.h"
#include "tests/attack/shapes.h"

enum { MAX_PLACES = 3, MAX_PAGES = 8, THREADS = 2 };

struct selections {
    struct tetlod_file *file;
    const struct tetlod_info *info;
    struct tetlod_cursor *cursor;
    struct dice dice;
    struct oracle_mesh original;
    struct oracle_counts counts;
    double *positions, *values[ORACLE_MAX_VALUES], *region; /* [tets] numbers of regions; NULL: none */
    uint32_t *corners, *parents, *part, field_of[ORACLE_MAX_VALUES];
    double diagonal, share;
    uint64_t seed;
    unsigned findings;
    /* the current one */
    const char *kind;
    struct tetlod_place places[MAX_PLACES];
    uint32_t place_count, finest;
    uint32_t *vertices, *tets, *levels, *same_as; /* numbers, levels; [original vertex] which one it is taken as */
    struct oracle_mesh level;
    uint32_t *level_part;
};

__attribute__((format(printf, 3, 4))) static void found(struct selections *s, const char *what, const char *format, ...)
{
    va_list list;
    printf("seed %" PRIu64 " (%s, %u tets): %s: ", s->seed, s->kind, s->level.tets, what);
    va_start(list, format);
    vprintf(format, list);
    va_end(list);
    puts("");
    s->findings++;
}

static void must(bool good, const struct tetlod_error *error)
{
    if (good)
        return;
    fprintf(stderr, "page_selections: %s\n", error->message);
    exit(2);
}

/* ---- the stream */

static void *read_all(const char *path, size_t *out_size)
{
    FILE *in = fopen(path, "rb");
    must(in && fseek(in, 0, SEEK_END) == 0, &(struct tetlod_error){.message = "the stream cannot be read"});
    *out_size = (size_t)ftell(in);
    rewind(in);
    void *bytes = oracle_memory(*out_size, 1);
    *out_size = fread(bytes, 1, *out_size, in);
    fclose(in);
    return bytes;
}

static void *copy_of(const void *from, size_t count, size_t size)
{
    return memcpy(oracle_memory(count, size), from, count * size);
}

/* Controlled fields' components. */
static void take_values(struct selections *s, const struct tetlod_mesh *mesh, struct oracle_mesh *out)
{
    out->value_count = 0;
    for (uint32_t f = 0; f < s->info->field_count; f++)
        for (uint32_t c = 0; c < s->info->fields[f].components && s->info->fields[f].controlled; c++) {
            if (out->value_count == ORACLE_MAX_VALUES)
                return;
            s->field_of[out->value_count] = f;
            out->values[out->value_count] = mesh->fields[f] + c;
            out->strides[out->value_count++] = s->info->fields[f].components;
        }
}

static void take_original(struct selections *s)
{
    struct tetlod_error error;
    struct tetlod_mesh mesh;
    must(tetlod_cursor_seek(s->cursor, s->info->level_count - 1, &error) == TETLOD_OK, &error);
    tetlod_cursor_mesh(s->cursor, &mesh);
    s->positions = copy_of(mesh.positions, 3 * (size_t)mesh.vertices, sizeof(double));
    s->corners = copy_of(mesh.corners, 4 * (size_t)mesh.tets, sizeof *s->corners);
    s->parents = copy_of(mesh.parents, mesh.vertices, sizeof *s->parents);
    s->part = oracle_memory(mesh.vertices, sizeof *s->part);
    oracle_parts(mesh.vertices, s->corners, mesh.tets, s->part);
    s->original = (struct oracle_mesh){mesh.vertices, mesh.tets, 0, s->positions, s->corners, .part = s->part,
                                       .turn = oracle_turn(s->positions, s->corners, mesh.tets)};
    take_values(s, &mesh, &s->original);
    for (uint32_t i = 0; i < s->original.value_count; i++) {
        size_t stride = s->original.strides[i];
        s->values[i] = oracle_memory(mesh.vertices, sizeof(double));
        for (size_t v = 0; v < mesh.vertices; v++)
            s->values[i][v] = s->original.values[i][v * stride];
        s->original.values[i] = s->values[i];
        s->original.strides[i] = 1;
    }
    for (uint32_t f = 0; f < s->info->cell_field_count && !s->region; f++)
        if (s->info->cell_fields[f].region) {
            s->region = oracle_memory(mesh.tets, sizeof *s->region);
            must(tetlod_cells(s->file, f, s->region, &error) == TETLOD_OK, &error);
        }
    oracle_prepare(&s->original);
    oracle_count(&s->original, &s->counts);
}

static void open_stream(struct selections *s, const void *bytes, size_t size)
{
    struct tetlod_error error;
    const struct tetlod_options options = {.struct_size = sizeof options, .threads = THREADS};
    double sum = 0;
    must(tetlod_open_memory(&s->file, bytes, size, &options, &error) == TETLOD_OK, &error);
    must(tetlod_cursor_new(&s->cursor, s->file, NULL, 0, &error) == TETLOD_OK, &error);
    s->info = tetlod_info(s->file);
    must(s->info->page_count && s->info->lossless, &(struct tetlod_error){.message = "not lossless, in pages"});
    s->finest = s->info->level_count - 1 - (s->info->exact_last != 0);
    for (int d = 0; d < 3; d++)
        sum += pow(s->info->bounds[1][d] - s->info->bounds[0][d], 2);
    s->diagonal = sqrt(sum);
    s->vertices = oracle_memory(s->info->vertices, sizeof *s->vertices);
    s->same_as = oracle_memory(s->info->vertices, sizeof *s->same_as);
    s->level_part = oracle_memory(s->info->vertices, sizeof *s->level_part);
    s->tets = oracle_memory(s->info->tets, sizeof *s->tets);
    s->levels = oracle_memory(s->info->tets, sizeof *s->levels);
    take_original(s);
}

/* ---- a set */

static uint32_t any_paged(struct selections *s)
{
    return s->info->first_paged_level + dice_below(&s->dice, s->finest - s->info->first_paged_level + 1);
}

static void random_point(struct selections *s, double out[3])
{
    const double *at = s->positions + 3 * (size_t)dice_below(&s->dice, s->original.vertices);
    for (int d = 0; d < 3; d++)
        out[d] = at[d] + 0.05 * s->diagonal * (dice_unit(&s->dice) - 0.5);
}

static void choose_places(struct selections *s, bool balls)
{
    s->place_count = 1 + dice_below(&s->dice, MAX_PLACES);
    for (uint32_t i = 0; i < s->place_count; i++) {
        struct tetlod_place *place = &s->places[i];
        double size = s->diagonal * 0.3 * dice_unit(&s->dice) * dice_unit(&s->dice) + 1e-6 * s->diagonal;
        random_point(s, place->low);
        place->radius = balls ? size : 0;
        place->level = any_paged(s);
        for (int d = 0; d < 3; d++)
            place->high[d] = place->low[d] + size * (0.2 + dice_unit(&s->dice));
    }
}

static void add(struct tetlod_page_set *set, uint32_t level, uint32_t page)
{
    struct tetlod_error error;
    must(tetlod_page_set_add(set, level, page, &error) == TETLOD_OK, &error);
}

/* Pages whose level before them is off by more than their distance from a point allows. */
static void add_by_error(struct selections *s, struct tetlod_page_set *set)
{
    double eye[3], allowed = pow(10, -4 * dice_unit(&s->dice)) / s->diagonal;
    random_point(s, eye);
    for (uint32_t level = s->info->first_paged_level; level <= s->finest; level++)
        for (uint32_t p = 0; p < tetlod_page_count(s->file, level); p++) {
            struct tetlod_page page;
            double sum = 0, off = s->info->levels[level - 1].errors[s->field_of[0] * TETLOD_MEASURES + TETLOD_MAX];
            must(tetlod_page(s->file, level, p, &page, NULL) == TETLOD_OK, &(struct tetlod_error){.message = "page"});
            for (int d = 0; d < 3; d++)
                sum += pow(fmax(0, fmax(page.low[d] - eye[d], eye[d] - page.high[d])), 2);
            if (off > allowed * sqrt(sum))
                add(set, level, p);
        }
}

static struct tetlod_page_set *choose_set(struct selections *s)
{
    static const char *const kinds[] = {"boxes", "balls", "pages", "errors"};
    struct tetlod_page_set *set;
    struct tetlod_error error;
    uint32_t kind = dice_below(&s->dice, 4), least = dice_below(&s->dice, s->info->first_paged_level + 1);
    s->kind = kinds[kind];
    s->place_count = 0;
    if (kind < 2)
        choose_places(s, kind == 1);
    must(tetlod_page_set_new(&set, s->file, least, s->places, s->place_count, &error) == TETLOD_OK, &error);
    for (uint32_t i = kind == 2 ? 1 + dice_below(&s->dice, MAX_PAGES) : 0; i > 0; i--) {
        uint32_t level = any_paged(s);
        add(set, level, dice_below(&s->dice, tetlod_page_count(s->file, level)));
    }
    if (kind == 3)
        add_by_error(s, set);
    return set;
}

/* The cursor goes there. */
static void take_set(struct selections *s)
{
    struct tetlod_page_set *set = choose_set(s);
    struct tetlod_page_set_info about;
    struct tetlod_error error;
    struct tetlod_mesh mesh;
    tetlod_page_set_info(set, &about);
    must(tetlod_cursor_select(s->cursor, set, &error) == TETLOD_OK, &error);
    must(tetlod_cursor_seek(s->cursor, about.level, &error) == TETLOD_OK, &error);
    tetlod_page_set_free(set);
    tetlod_cursor_mesh(s->cursor, &mesh);
    tetlod_cursor_numbers(s->cursor, s->vertices, s->tets);
    tetlod_cursor_tet_levels(s->cursor, s->levels);
    s->level = (struct oracle_mesh){mesh.vertices, mesh.tets, 0, mesh.positions, mesh.corners, .part = s->level_part,
                                    .turn = s->original.turn};
    take_values(s, &mesh, &s->level);
    for (uint32_t v = 0; v < mesh.vertices; v++)
        s->level_part[v] = s->part[s->vertices[v]];
    if (about.vertices != mesh.vertices || about.tets != mesh.tets)
        found(s, "counts", "%" PRIu64 " vertices, %" PRIu64 " tets were announced", about.vertices, about.tets);
}

/* ---- what holds of it */

static bool all_different(const uint32_t v[4])
{
    return v[0] != v[1] && v[0] != v[2] && v[0] != v[3] && v[1] != v[2] && v[1] != v[3] && v[2] != v[3];
}

/* Is it the original with some vertices taken as one? */
static void check_quotient(struct selections *s)
{
    const struct oracle_mesh *original = &s->original;
    for (uint32_t v = 0, at = 0; v < original->vertices; v++) {
        bool there = at < s->level.vertices && s->vertices[at] == v;
        s->same_as[v] = there ? at++ : s->same_as[s->parents[v]];
    }
    for (uint32_t t = 0, at = 0; t < original->tets; t++) {
        uint32_t corners[4];
        for (size_t i = 0; i < 4; i++)
            corners[i] = s->same_as[s->corners[4 * (size_t)t + i]];
        bool there = at < s->level.tets && s->tets[at] == t;
        if (there != all_different(corners) ||
            (there && memcmp(corners, s->level.corners + 4 * (size_t)at, sizeof corners) != 0)) {
            found(s, "crack", "tet %u of the original is %s", t, there ? "there" : "not there");
            return;
        }
        at += there;
    }
}

static void check_topology(struct selections *s)
{
    struct oracle_counts now;
    const struct oracle_counts *then = &s->counts;
    oracle_count(&s->level, &now);
    if (now.euler != then->euler || now.parts != then->parts || now.boundary_parts != then->boundary_parts ||
        now.overfull_faces > then->overfull_faces || now.duplicates > then->duplicates)
        found(s, "topology", "euler %ld, parts %ld, boundaries %ld, overfull %ld; was %ld, %ld, %ld, %ld", now.euler,
              now.parts, now.boundary_parts, now.overfull_faces, then->euler, then->parts, then->boundary_parts,
              then->overfull_faces);
    if (now.inverted > then->inverted || now.flat > then->flat)
        found(s, "orientation", "%ld inverted, %ld flat; was %ld, %ld", now.inverted, now.flat, then->inverted,
              then->flat);
}

/* Six times the sum of volumes of a region's tetrahedra; numbers NULL: they are the original's. */
static quad volume_of(const struct selections *s, const struct oracle_mesh *mesh, const uint32_t *numbers, double of)
{
    quad sum = 0;
    for (uint32_t t = 0; t < mesh->tets; t++) {
        const uint32_t *c = mesh->corners + 4 * (size_t)t;
        quad e[3][3];
        if (s->region && s->region[numbers ? numbers[t] : t] != of)
            continue;
        for (int i = 0; i < 3; i++)
            for (int d = 0; d < 3; d++)
                e[i][d] = (quad)mesh->positions[3 * (size_t)c[i + 1] + (size_t)d] -
                          mesh->positions[3 * (size_t)c[0] + (size_t)d];
        for (int d = 0; d < 3; d++)
            sum += e[0][d] * (e[1][(d + 1) % 3] * e[2][(d + 2) % 3] - e[1][(d + 2) % 3] * e[2][(d + 1) % 3]);
    }
    return sum;
}

static void check_volumes(struct selections *s)
{
    double of = s->region ? s->region[dice_below(&s->dice, s->original.tets)] : 0;
    double was = (double)volume_of(s, &s->original, NULL, of), is = (double)volume_of(s, &s->level, s->tets, of);
    if (s->info->levels[0].domain_error == 0 && fabs(is - was) > 1e-12 * pow(s->diagonal, 3))
        found(s, "volume", "of region %g: %.17g, was %.17g", of, is / 6, was / 6);
}

static bool holds(const struct tetlod_place *place, const double x[3])
{
    double sum = 0;
    bool inside = true;
    for (int d = 0; d < 3; d++) {
        sum += (x[d] - place->low[d]) * (x[d] - place->low[d]);
        inside &= x[d] >= place->low[d] && x[d] <= place->high[d];
    }
    return place->radius > 0 ? sum <= place->radius * place->radius : inside;
}

static void check_places(struct selections *s)
{
    for (uint32_t i = 0; i < s->place_count; i++)
        for (size_t c = 0; c < 4 * (size_t)s->level.tets; c++)
            if (s->levels[c / 4] < s->places[i].level &&
                holds(&s->places[i], s->level.positions + 3 * (size_t)s->level.corners[c])) {
                found(s, "place", "level %u was asked for, tet %zu is of level %u", s->places[i].level, c / 4,
                      s->levels[c / 4]);
                return;
            }
}

/* What value i may be off where a level is. */
static double allowed(const struct selections *s, uint32_t level, uint32_t i)
{
    const struct tetlod_field *field = &s->info->fields[s->field_of[i]];
    double range = field->range[1] - field->range[0];
    double max = s->info->levels[level].errors[s->field_of[i] * TETLOD_MEASURES + TETLOD_MAX];
    return s->share * max * range * (1 + 1e-9) + 1e-15 * range;
}

static double radius_of(const struct selections *s, uint32_t level)
{
    return s->info->levels[level].domain_error * s->diagonal * (1 + 1e-9) + 4e-12 * s->diagonal;
}

/* The tetrahedra of one level: in them, by the overlay. */
static void check_level(struct selections *s, uint32_t level)
{
    struct oracle_place worst[ORACLE_MAX_VALUES] = {0};
    for (uint32_t i = 0; i < s->level.value_count; i++)
        worst[i].difference = allowed(s, level, i);
    oracle_overlay_above(&s->original, &s->level, radius_of(s, level), worst);
    for (uint32_t i = 0; i < s->level.value_count; i++) {
        uint32_t part = s->part[s->corners[4 * (size_t)worst[i].tet]];
        double most = allowed(s, level, i);
        if (worst[i].difference > most &&
            !(s->info->levels[level].domain_error > 0 &&
              oracle_partner(&s->level, part, worst[i].position, radius_of(s, level), i, worst[i].value, most)))
            found(s, "max", "level %u, %s: %.9g is allowed, it is %.9g at (%.17g, %.17g, %.17g)", level,
                  s->info->fields[s->field_of[i]].name, most, worst[i].difference, worst[i].position[0],
                  worst[i].position[1], worst[i].position[2]);
    }
}

static void check_errors(struct selections *s)
{
    bool *wanted = oracle_memory(s->level.tets, sizeof *wanted);
    for (uint32_t level = 0; level < s->info->level_count; level++) {
        bool any = false;
        for (uint32_t t = 0; t < s->level.tets; t++)
            any |= wanted[t] = s->levels[t] == level;
        s->level.wanted = wanted;
        if (any)
            check_level(s, level);
        s->level.wanted = NULL;
    }
    free(wanted);
}

/* Each original vertex has a partner, also where the boundary has moved away from it. */
static void check_vertices(struct selections *s)
{
    uint32_t coarsest = s->info->level_count - 1;
    for (uint32_t t = 0; t < s->level.tets; t++)
        coarsest = s->levels[t] < coarsest ? s->levels[t] : coarsest;
    for (uint32_t v = 0; v < s->original.vertices; v++)
        for (uint32_t i = 0; i < s->original.value_count; i++) {
            const double *x = s->positions + 3 * (size_t)v;
            double off, most = allowed(s, coarsest, i);
            if ((oracle_difference_at(&s->level, s->part[v], x, i, s->values[i][v], &off) && off <= most) ||
                oracle_partner(&s->level, s->part[v], x, radius_of(s, coarsest), i, s->values[i][v], most))
                continue;
            found(s, "partner", "%s: none for vertex %u within %.9g, the value may be off by %.9g",
                  s->info->fields[s->field_of[i]].name, v, radius_of(s, coarsest), most);
            return;
        }
}

static void attack(struct selections *s, uint64_t seed)
{
    s->seed = seed;
    s->dice = (struct dice){seed * UINT64_C(0x9e3779b97f4a7c15)};
    take_set(s);
    check_quotient(s);
    check_topology(s);
    check_volumes(s);
    check_places(s);
    oracle_prepare(&s->level);
    check_errors(s);
    if (s->info->levels[0].domain_error > 0)
        check_vertices(s);
    oracle_finish(&s->level);
}

static void release(struct selections *s)
{
    tetlod_cursor_free(s->cursor);
    tetlod_close(s->file);
    oracle_finish(&s->original);
    for (uint32_t i = 0; i < s->original.value_count; i++)
        free(s->values[i]);
    free(s->positions);
    free(s->region);
    free(s->corners);
    free(s->parents);
    free(s->part);
    free(s->vertices);
    free(s->tets);
    free(s->levels);
    free(s->same_as);
    free(s->level_part);
}

int main(int argc, char **argv)
{
    struct selections s = {.share = argc == 5 ? strtod(argv[4], NULL) : 1};
    size_t size;
    if (argc != 4 && argc != 5) {
        fprintf(stderr, "usage: page_selections STREAM SEED COUNT [SHARE]\n");
        return 2;
    }
    void *bytes = read_all(argv[1], &size);
    open_stream(&s, bytes, size);
    uint64_t first = strtoull(argv[2], NULL, 10), count = strtoull(argv[3], NULL, 10);
    for (uint64_t seed = first; seed < first + count; seed++)
        attack(&s, seed);
    release(&s);
    free(bytes);
    return s.findings != 0;
}
