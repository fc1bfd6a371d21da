/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * usage: attack PROGRAM FOLDER FIRST COUNT
 *
 * Seeds FIRST .. FIRST + COUNT - 1: makes a mesh and options of the seed, has PROGRAM build and verify a stream of it
 * in FOLDER, and holds what the stream says against the oracle (oracle.h). A line for each finding; exit status 1 if
 * there is one. With KEEP=1 in the environment the mesh and the stream of the last seed stay in FOLDER.
 *
 *     seed 17 (torus, 96 tets): max: level 3 f0: stored 0.01, true 0.02 at (...) | build options
 */
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

#include "format/tetlod.h"
#include "format/write/writer.h"
#include "tests/attack/falsify.h"
#include "tests/attack/oracle.h"
#include "tests/attack/boxed.h"
#include "tests/attack/shapes.h"

struct attack {
    const char *program, *folder;
    uint64_t seed;
    struct dice dice;
    struct shape shape;
    char options[512];
    bool lossy, keep_order;
    char *bytes;
    size_t size;
    struct tetlod_file *file;
    const struct tetlod_info *info;
    struct tetlod_cursor *cursor;
    struct oracle_mesh original; /* the input in the stream's numbering */
    struct oracle_counts counts;
    double *positions, *values[ORACLE_MAX_VALUES];
    uint32_t *corners, *part, field_of[ORACLE_MAX_VALUES], component_of[ORACLE_MAX_VALUES];
    double diagonal;
    struct falsehood falsehood;
    unsigned findings;
};

__attribute__((format(printf, 3, 4))) static void found(struct attack *a, const char *what, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    shape_print_finding(&a->shape, a->seed, what, format, list);
    va_end(list);
    printf(" |%s\n", a->options);
    fflush(stdout);
    a->findings++;
}

static const char *path_of(const struct attack *a, const char *name)
{
    static char paths[4][1024];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof *paths, "%s/%s", a->folder, name);
    return path;
}

/* ---- options */

__attribute__((format(printf, 2, 3))) static void option(struct attack *a, const char *format, ...)
{
    size_t used = strlen(a->options);
    va_list list;
    va_start(list, format);
    vsnprintf(a->options + used, sizeof a->options - used, format, list);
    va_end(list);
}

static const char *one_of(struct attack *a, const char *const *words, uint32_t count)
{
    return words[dice_below(&a->dice, count)];
}

#define ONE_OF(a, ...) \
    one_of(a, (const char *const[]){__VA_ARGS__}, sizeof((const char *const[]){__VA_ARGS__}) / sizeof(const char *))

static void choose_fields(struct attack *a)
{
    for (uint32_t f = 0; f < a->shape.field_count; f++) {
        const struct shape_field *field = &a->shape.fields[f];
        if (f && dice_once_in(&a->dice, 2))
            continue;
        if (f == 0 && field->components == 1 && dice_once_in(&a->dice, 4))
            continue; // the default finds one, or another field is named
        if (field->components > 1 && dice_once_in(&a->dice, 2))
            option(a, " --field %s:%s", field->name, ONE_OF(a, "mag", "0"));
        else
            option(a, " --field %s%s", field->name, dice_once_in(&a->dice, 5) ? ONE_OF(a, ":0.01", ":5%", ":0.3") : "");
    }
}

static void choose_rare_options(struct attack *a)
{
    if (!strstr(a->options, "domain-error") && dice_once_in(&a->dice, 3))
        option(a, " --domain-error %s", ONE_OF(a, "0.0003", "0.001", "0.6", "1"));
    if (!strstr(a->options, "boundary-angle") && dice_once_in(&a->dice, 4))
        option(a, " --boundary-angle %s", ONE_OF(a, "2", "45", "120"));
    if (dice_once_in(&a->dice, 8))
        option(a, " --min-tets %u", 1 + dice_below(&a->dice, a->shape.tets));
    if (a->shape.region && dice_once_in(&a->dice, 4))
        option(a, " --region none");
    if (strstr(a->options, "--field f0") && dice_once_in(&a->dice, 6))
        option(a, " --carry f0%s", a->shape.marks ? "," SHAPE_MARK : "");
}

/* Of a third of the seeds that can have one: it draws no dice, so that a seed's other options are what they were. */
static void choose_local_bound(struct attack *a)
{
    const char *domain = strstr(a->options, "--domain-error ");
    bool kept = !domain || strtod(domain + strlen("--domain-error "), NULL) <= 0.001;
    if ((a->seed % 3 == 0 || a->shape.marks) && kept && !a->lossy && !strstr(a->options, "exact") &&
        !strstr(a->options, "measured"))
        option(a, " --local-bound");
}

static void choose_options(struct attack *a)
{
    struct dice *dice = &a->dice;
    a->options[0] = 0;
    choose_fields(a);
    bool exact = dice_once_in(dice, 3);
    if (exact)
        option(a, " --certify exact");
    if (dice_once_in(dice, 3)) // the last two have limits of their own
        option(a, " --metric %s", exact ? ONE_OF(a, "quadric", "field-quadric", "envelope")
                                        : ONE_OF(a, "quadric", "field-quadric", "envelope", "sva", "measured"));
    if (dice_once_in(dice, 5))
        option(a, " --contract %s", ONE_OF(a, "face", "tet", "hybrid"));
    if (dice_once_in(dice, 2))
        option(a, " --domain-error %s", ONE_OF(a, "0", "0.01", "0.03", "0.1", "0.3"));
    if (dice_once_in(dice, 3))
        option(a, " --boundary-angle %s", ONE_OF(a, "0", "10", "60", "90", "180"));
    option(a, " --growth %s", ONE_OF(a, "1.05", "1.3", "2", "5"));
    if (dice_once_in(dice, 8))
        option(a, " --position-bits %u", 4 + dice_below(dice, 18));
    else if (dice_once_in(dice, 12))
        option(a, " --position-error %s", ONE_OF(a, "0.01", "0.0001"));
    if (dice_once_in(dice, 8))
        option(a, " --field-bits %u", 3 + dice_below(dice, 18));
    else if (dice_once_in(dice, 12))
        option(a, " --field-error %s", ONE_OF(a, "0.01", "0.0001"));
    if (dice_once_in(dice, 6))
        option(a, " --max-error %s", ONE_OF(a, "0.001", "0.05", "0.5"));
    if (a->seed >= SHAPE_ODD_SEEDS && dice_once_in(dice, 4))
        option(a, " --certify-all");
    if (a->seed >= SHAPE_RARE_SEEDS)
        choose_rare_options(a);
    if (dice_once_in(dice, 6)) // what this chose is no option any more; seeds keep the others
        (void)dice_below(dice, 6);
    a->lossy = strstr(a->options, "position-") || strstr(a->options, "field-b") || strstr(a->options, "field-e");
    a->keep_order = a->lossy || dice_once_in(dice, 2);
    option(a, "%s --threads %u", a->keep_order ? " --keep-order" : "", 1 + dice_below(dice, 2));
    choose_local_bound(a);
}

/* ---- the program */

static int run(struct attack *a, const char *command, const char *operands)
{
    char line[4096];
    snprintf(line, sizeof line, "timeout 300 %s %s %s >%s 2>&1", a->program, command, operands, path_of(a, "said"));
    int status = system(line);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

static const char *said(struct attack *a)
{
    static char text[8192];
    FILE *file = fopen(path_of(a, "said"), "r");
    size_t size = file ? fread(text, 1, sizeof text - 1, file) : 0;
    if (file)
        fclose(file);
    text[size] = 0;
    for (char *at = text; *at; at++)
        *at = *at == '\n' ? ' ' : *at;
    return text;
}

static bool build(struct attack *a)
{
    char operands[2048];
    if (!shape_write(&a->shape, path_of(a, "mesh.vtk"))) {
        perror(path_of(a, "mesh.vtk"));
        exit(2);
    }
    snprintf(operands, sizeof operands, "%s -o %s --quiet --compress 1%s", path_of(a, "mesh.vtk"),
             path_of(a, "mesh.tetlod"),
             a->options);
    int status = run(a, "build", operands);
    if (status == 0)
        return true;
    const char *text = said(a);
    bool refused = status == 3 ? strstr(text, "too wide for") || strstr(text, "too narrow for")
                               : status == 2 && strstr(text, "rounding alone");
    if (!refused)
        found(a, "build", "exit status %d: %s", status, text);
    return false;
}

static int verify(struct attack *a, const char *stream)
{
    char operands[2048];
    snprintf(operands, sizeof operands, "%s --against %s --quiet --json", path_of(a, stream), path_of(a, "mesh.vtk"));
    return run(a, "verify", operands);
}

/* ---- the stream */

static bool open_stream(struct attack *a)
{
    struct tetlod_error error = {0};
    FILE *file = fopen(path_of(a, "mesh.tetlod"), "rb");
    if (file) {
        fseek(file, 0, SEEK_END);
        a->size = (size_t)ftell(file);
        rewind(file);
        a->bytes = oracle_memory(a->size, 1);
        a->size = fread(a->bytes, 1, a->size, file);
        fclose(file);
    }
    if (tetlod_open_memory(&a->file, a->bytes, a->size, NULL, &error) != TETLOD_OK ||
        tetlod_cursor_new(&a->cursor, a->file, NULL, 0, &error) != TETLOD_OK ||
        tetlod_cursor_seek(a->cursor, tetlod_info(a->file)->level_count - 1, &error) != TETLOD_OK) {
        found(a, "stream", "%s", error.message);
        return false;
    }
    a->info = tetlod_info(a->file);
    return true;
}

static bool is_local_bound(const char *name)
{
    size_t length = strlen(name), suffix = strlen(TETLOD_BOUND_SUFFIX);
    return length > suffix && strcmp(name + length - suffix, TETLOD_BOUND_SUFFIX) == 0;
}

/* Value `component` of a field of the stream at vertex v of the input; derived ones are worked out. */
static double input_value(const struct attack *a, const char *name, uint32_t component, uint32_t v)
{
    if (is_local_bound(name))
        return 0;
    for (uint32_t f = 0; f < a->shape.field_count; f++) {
        const struct shape_field *field = &a->shape.fields[f];
        size_t length = strlen(field->name), n = field->components;
        if (strncmp(name, field->name, length) != 0 || (name[length] && name[length] != ':'))
            continue;
        const double *values = field->values + n * v;
        if (!name[length])
            return values[component];
        if (strcmp(name + length, ":mag") != 0)
            return values[atoi(name + length + 1)];
        double sum = 0;
        for (size_t i = 0; i < n; i++)
            sum += values[i] * values[i];
        return field->wide ? sqrt(sum) : (double)(float)sqrt(sum);
    }
    return NAN;
}

/* A number that follows from a vertex's position and values. */
static uint64_t fingerprint(const struct attack *a, const double *position, uint32_t v, bool input)
{
    uint64_t hash = 1;
    double row[3 + ORACLE_MAX_VALUES];
    memcpy(row, position, 3 * sizeof *row);
    for (uint32_t i = 0; i < a->original.value_count; i++)
        row[3 + i] = input ? input_value(a, a->info->fields[a->field_of[i]].name, a->component_of[i],
                                         v) : a->values[i][v];
    for (uint32_t i = 0; i < 3 + a->original.value_count; i++) {
        uint64_t bits;
        memcpy(&bits, &row[i], sizeof bits);
        hash = (hash ^ bits) * UINT64_C(0x9e3779b97f4a7c15);
        hash ^= hash >> 31;
    }
    return hash;
}

static int compare_numbers(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* Is the finest level the input, but for the order? Vertices and tetrahedra as sets of fingerprints. */
static bool same_sets(const struct attack *a)
{
    const struct shape *s = &a->shape;
    size_t n = s->vertices, t = s->tets;
    uint64_t *prints[2], *tets[2];
    for (int m = 0; m < 2; m++) {
        const uint32_t *corners = m ? a->corners : s->corners;
        prints[m] = oracle_memory(n, sizeof(uint64_t));
        tets[m] = oracle_memory(t, sizeof(uint64_t));
        for (size_t v = 0; v < n; v++)
            prints[m][v] = fingerprint(a, (m ? a->positions : s->positions) + 3 * v, (uint32_t)v, !m);
        for (size_t i = 0; i < 4 * t; i++) {
            uint64_t p = prints[m][corners[i]];
            tets[m][i / 4] += p * p ^ p >> 7;
        }
        qsort(prints[m], n, sizeof(uint64_t), compare_numbers);
        qsort(tets[m], t, sizeof(uint64_t), compare_numbers);
    }
    bool same = memcmp(prints[0], prints[1], n * sizeof(uint64_t)) == 0 && memcmp(tets[0], tets[1],
                                                                                  t * sizeof(uint64_t)) == 0;
    for (int m = 0; m < 2; m++) {
        free(prints[m]);
        free(tets[m]);
    }
    return same;
}

/* Takes the input's own positions and values, by the order that the stream keeps; false if that is none. */
static bool take_input(struct attack *a)
{
    const struct shape *s = &a->shape;
    uint32_t *vertices = oracle_memory(s->vertices, sizeof *vertices), *tets = oracle_memory(s->tets, sizeof *tets);
    uint8_t *places = oracle_memory(4 * (size_t)s->tets, 1);
    bool good = tetlod_order(a->file, vertices, tets, places, NULL) == TETLOD_OK;
    for (size_t t = 0; t < s->tets && good; t++)
        for (size_t c = 0; c < 4; c++)
            good &= s->corners[4 * (size_t)tets[t] + c] == vertices[a->corners[4 * t + places[4 * t + c]]];
    for (size_t v = 0; v < s->vertices && good; v++) {
        const double *from = s->positions + 3 * (size_t)vertices[v];
        good &= a->lossy || memcmp(a->positions + 3 * v, from, 3 * sizeof *from) == 0;
        memcpy(a->positions + 3 * v, from, 3 * sizeof *from);
        for (uint32_t i = 0; i < a->original.value_count; i++) {
            double value = input_value(a, a->info->fields[a->field_of[i]].name, a->component_of[i], vertices[v]);
            good &= a->lossy || a->values[i][v] == value;
            a->values[i][v] = value;
        }
    }
    free(vertices);
    free(tets);
    free(places);
    return good;
}

/* The finest level becomes the original, after it is the input, or was replaced by it. */
static bool take_original(struct attack *a)
{
    struct tetlod_mesh mesh;
    tetlod_cursor_mesh(a->cursor, &mesh);
    if (mesh.vertices != a->shape.vertices || mesh.tets != a->shape.tets) {
        found(a, "finest", "%u vertices, %u tets, the input has %u vertices", mesh.vertices, mesh.tets,
              a->shape.vertices);
        return false;
    }
    struct oracle_mesh *o = &a->original;
    a->positions = oracle_memory(3 * (size_t)mesh.vertices, sizeof(double));
    a->corners = oracle_memory(4 * (size_t)mesh.tets, sizeof(uint32_t));
    a->part = oracle_memory(mesh.vertices, sizeof(uint32_t));
    memcpy(a->positions, mesh.positions, 3 * (size_t)mesh.vertices * sizeof(double));
    memcpy(a->corners, mesh.corners, 4 * (size_t)mesh.tets * sizeof(uint32_t));
    *o = (struct oracle_mesh){mesh.vertices, mesh.tets, 0, a->positions, a->corners, .part = a->part};
    for (uint32_t f = 0; f < a->info->field_count; f++)
        for (uint32_t c = 0; c < a->info->fields[f].components && o->value_count < ORACLE_MAX_VALUES; c++) {
            uint32_t i = o->value_count++, n = a->info->fields[f].components;
            a->field_of[i] = f;
            a->component_of[i] = c;
            a->values[i] = oracle_memory(mesh.vertices, sizeof(double));
            for (size_t v = 0; v < mesh.vertices; v++)
                a->values[i][v] = mesh.fields[f][n * v + c];
            o->values[i] = a->values[i];
            o->strides[i] = 1;
        }
    if (a->keep_order ? !take_input(a) : !same_sets(a)) {
        found(a, "finest", "it is not the input");
        return false;
    }
    oracle_parts(mesh.vertices, a->corners, mesh.tets, a->part);
    o->turn = oracle_turn(a->positions, a->corners, mesh.tets);
    oracle_prepare(o);
    oracle_leave_out_folds(o);
    oracle_count(o, &a->counts);
    double sum = 0;
    for (int d = 0; d < 3; d++)
        sum += (a->info->bounds[1][d] - a->info->bounds[0][d]) * (a->info->bounds[1][d] - a->info->bounds[0][d]);
    a->diagonal = sqrt(sum);
    return true;
}

/* ---- a level */

static double error_of(const struct attack *a, uint32_t level, uint32_t field, enum tetlod_measure measure)
{
    return a->info->levels[level].errors[field * TETLOD_MEASURES + (uint32_t)measure];
}

static double range_of(const struct attack *a, uint32_t field)
{
    return a->info->fields[field].range[1] - a->info->fields[field].range[0];
}

static void check_topology(struct attack *a, uint32_t k, const struct oracle_mesh *level)
{
    struct oracle_counts now;
    const struct oracle_counts *then = &a->counts;
    oracle_count(level, &now);
    if (now.euler != then->euler || now.parts != then->parts || now.boundary_parts != then->boundary_parts)
        found(a, "topology", "level %u: euler %ld, parts %ld, boundaries %ld; was %ld, %ld, %ld", k, now.euler,
              now.parts,
              now.boundary_parts, then->euler, then->parts, then->boundary_parts);
    if (now.overfull_faces > then->overfull_faces || now.duplicates > then->duplicates)
        found(a, "topology", "level %u: %ld overfull faces, %ld duplicates; was %ld, %ld", k, now.overfull_faces,
              now.duplicates, then->overfull_faces, then->duplicates);
    if (!a->lossy && (now.inverted > then->inverted || now.flat > then->flat))
        found(a, "orientation", "level %u: %ld inverted, %ld flat; was %ld, %ld", k, now.inverted, now.flat,
              then->inverted,
              then->flat);
}

static double domain_radius(const struct attack *a, uint32_t k)
{
    return a->info->levels[k].domain_error * a->diagonal * (1 + 1e-9) + 4e-12 * a->diagonal;
}

/* A value of the original at a point: is there a point of the level close by that has about it? */
static bool has_partner(const struct attack *a, uint32_t k, const struct oracle_mesh *level, uint32_t tet,
                        const double point[3],
                        uint32_t i, double value)
{
    uint32_t field = a->field_of[i];
    double within = error_of(a, k, field, TETLOD_MAX) * range_of(a, field);
    within = within * (1 + 1e-6) + 1e-9 * range_of(a, field);
    return oracle_partner(level, a->part[a->corners[4 * (size_t)tet]], point, domain_radius(a, k), i, value, within);
}

static void check_max(struct attack *a, uint32_t k, const struct oracle_mesh *level)
{
    struct oracle_place worst[ORACLE_MAX_VALUES];
    oracle_overlay(&a->original, level, domain_radius(a, k), worst);
    for (uint32_t i = 0; i < a->original.value_count; i++) {
        uint32_t f = a->field_of[i];
        double stored = error_of(a, k, f, TETLOD_MAX), range = range_of(a, f), truth = worst[i].difference;
        if (isnan(stored) || !(range > 0))
            continue;
        falsehood_note(&a->falsehood.max[(size_t)k * a->info->field_count + f], truth / range);
        if (truth <= stored * range * (1 + 1e-9) + 1e-16 * range)
            continue;
        bool partner = a->info->levels[k].domain_error > 1e-9 &&
                       has_partner(a, k, level, worst[i].tet, worst[i].position, i, worst[i].value);
        found(a, partner ? "max beside its partner" : "max",
              "level %u of %u, %s: stored %.9g, true %.9g of tet %u at (%.17g, %.17g, %.17g)", k, a->info->level_count,
              a->info->fields[f].name, stored, truth / range, worst[i].tet, worst[i].position[0], worst[i].position[1],
              worst[i].position[2]);
    }
}

static bool once(unsigned *set, uint32_t member)
{
    bool first = !(*set >> member & 1);
    *set |= 1u << member;
    return first;
}

/* Vertices that rounding may put outside their own sheet and into another of the same body, with which the oracle
 * compares them: those of folds; and, of rounded positions, on the boundary where the body overlaps itself at faces of
 * more than two tetrahedra, and where another sheet touches it. */
static bool *find_strays(const struct attack *a)
{
    const struct oracle_mesh *o = &a->original;
    bool *strays = oracle_memory(o->vertices, 1);
    bool moved = a->lossy && strstr(a->options, "position-");
    size_t count = a->lossy ? 4 * (size_t)o->tets : 0;
    struct oracle_face *faces = oracle_faces(o);
    for (size_t c = 0; c < count; c++)
        strays[a->corners[c]] |= !o->details[c / 4].usable;
    for (size_t i = 0, end; i < count && a->counts.overfull_faces && moved; i = end) {
        for (end = i + 1; end < count && oracle_same_face(&faces[i], &faces[end]);)
            end++;
        for (int k = 0; k < 3 && end - i != 2; k++)
            strays[faces[i].v[k]] = true;
    }
    free(faces);
    for (uint32_t v = 0; v < o->vertices && moved; v++)
        strays[v] |= oracle_touches(o, a->part[v], a->positions + 3 * (size_t)v);
    return strays;
}

/* Original vertices, where `sampled` cannot be below the difference; those outside the level have a partner. */
static void check_vertices(struct attack *a, uint32_t k, const struct oracle_mesh *level)
{
    bool *done = find_strays(a);
    unsigned reported[2] = {0, 0}; /* sets of values: one line for each is enough */
    for (size_t c = 0; c < 4 * (size_t)a->original.tets; c++) {
        uint32_t v = a->corners[c];
        const double *p = a->positions + 3 * (size_t)v;
        if (done[v] || !a->original.details[c / 4].usable)
            continue;
        done[v] = true;
        for (uint32_t i = 0; i < a->original.value_count; i++) {
            uint32_t f = a->field_of[i];
            double here, range = range_of(a, f), sampled = error_of(a, k, f, TETLOD_SAMPLED);
            double slack = 1e-6 * range;
            bool held = oracle_difference_at(level, a->part[v], p, i, a->values[i][v], &here);
            if (held && range > 0)
                falsehood_note(&a->falsehood.sampled[(size_t)k * a->info->field_count + f], (here - slack) / range);
            if (held && here > sampled * range + slack && once(&reported[0], i))
                found(a, "sampled", "level %u, %s: stored %.9g, at vertex %u it is %.9g", k, a->info->fields[f].name,
                      sampled,
                      v, here / range);
            if (!held && !isnan(error_of(a, k, f, TETLOD_MAX)) &&
                !has_partner(a, k, level, (uint32_t)(c / 4), p, i, a->values[i][v]) && once(&reported[1], i))
                found(a, "partner", "level %u, %s: stored %.9g, domain error %.9g: none for vertex %u", k,
                      a->info->fields[f].name, error_of(a, k, f, TETLOD_MAX), a->info->levels[k].domain_error, v);
        }
    }
    free(done);
}

static void check_domain(struct attack *a, uint32_t k, const struct oracle_mesh *level)
{
    double there = oracle_boundary_distance(&a->original, level), back = oracle_boundary_distance(level, &a->original);
    double truth = fmax(there, back);
    a->falsehood.domain[k] = truth / a->diagonal;
    if (truth > domain_radius(a, k))
        found(a, "domain error", "level %u: stored %.9g, true %.9g", k, a->info->levels[k].domain_error,
              truth / a->diagonal);
}

static void check_level(struct attack *a, uint32_t k)
{
    struct tetlod_mesh mesh;
    struct tetlod_error error = {0};
    if (tetlod_cursor_seek(a->cursor, k, &error) != TETLOD_OK) {
        found(a, "stream", "level %u: %s", k, error.message);
        return;
    }
    tetlod_cursor_mesh(a->cursor, &mesh);
    struct oracle_mesh level = {mesh.vertices, mesh.tets, a->original.value_count, mesh.positions, mesh.corners,
                                .part = a->part, .turn = a->original.turn};
    for (uint32_t i = 0; i < level.value_count; i++) {
        level.values[i] = mesh.fields[a->field_of[i]] + a->component_of[i];
        level.strides[i] = a->info->fields[a->field_of[i]].components;
    }
    oracle_prepare(&level);
    check_topology(a, k, &level);
    check_max(a, k, &level);
    check_vertices(a, k, &level);
    check_domain(a, k, &level);
    oracle_finish(&level);
}

/* ---- the index */

static void check_index(struct attack *a)
{
    for (uint32_t k = 0; k < a->info->level_count; k++)
        for (uint32_t f = 0; f < a->info->field_count; f++) {
            double max = error_of(a, k, f, TETLOD_MAX), sampled = error_of(a, k, f, TETLOD_SAMPLED);
            if (sampled > max * (1 + 1e-9) || error_of(a, k, f, TETLOD_RMS) > sampled * (1 + 1e-9))
                found(a, "index", "level %u, %s: max %g, sampled %g, rms %g", k, a->info->fields[f].name, max, sampled,
                      error_of(a, k, f, TETLOD_RMS));
            for (int m = 0; m < TETLOD_MEASURES && k; m++)
                if (error_of(a, k, f, (enum tetlod_measure)m) > error_of(a, k - 1, f, (enum tetlod_measure)m))
                    found(a, "index", "level %u, %s: its %s is above that of level %u", k, a->info->fields[f].name,
                          tetlod_measure_name((enum tetlod_measure)m), k - 1);
        }
}

/* ---- a seed */

/* Of the other levels verify does not know the exact maximum, and says so. */
static void forget_unseen_levels(struct attack *a)
{
    const char *list = strstr(said(a), "\"exact_levels\"");
    bool *seen = oracle_memory(a->info->level_count, 1);
    for (list = list ? strchr(list, '[') : NULL; list && *list != ']' && *list; list += 1 + strcspn(list + 1, ",]")) {
        unsigned long level = strtoul(list + 1, NULL, 10);
        if (level < a->info->level_count)
            seen[level] = true;
    }
    for (size_t i = 0; i < (size_t)a->info->level_count * a->info->field_count; i++)
        if (!seen[i / a->info->field_count])
            a->falsehood.max[i] = NAN;
    free(seen);
}

static void check_verdicts(struct attack *a)
{
    unsigned before = a->findings;
    int status = verify(a, "mesh.tetlod");
    forget_unseen_levels(a);
    if (status != 0)
        found(a, before ? "verify agrees" : "verify rejects", "exit status %d: %.240s", status, said(a));
    a->findings = before + (status != 0 && !before);
    if (status != 0 || before || a->lossy)
        return;
    char text[200];
    bool lie;
    if (falsehood_write_bound(&a->falsehood, a->file, path_of(a, "lie.tetlod"), text, sizeof text) &&
        (status = verify(a, "lie.tetlod")) != 3)
        found(a, "verify accepts", "exit status %d: %s: %.200s", status, text, said(a));
    if (!falsehood_write(&a->falsehood, a->file, &a->dice, path_of(a, "lie.tetlod"), &lie, text, sizeof text))
        return;
    status = verify(a, "lie.tetlod");
    if (status != (lie ? 3 : 0))
        found(a, lie ? "verify accepts" : "verify rejects", "sealed again, exit status %d: %s: %.200s", status, text,
              said(a));
}

/* ---- finer in boxes */

/* Parts by number, in the input's numbering. */
static void mark_parts(struct shape *shape)
{
    uint32_t *part = oracle_memory(shape->vertices, sizeof *part);
    shape->marks = oracle_memory(shape->tets, sizeof *shape->marks);
    oracle_parts(shape->vertices, shape->corners, shape->tets, part);
    uint32_t *number = oracle_memory(shape->vertices, sizeof *number), count = 0;
    for (uint32_t t = 0; t < shape->tets; t++) {
        uint32_t *of = &number[part[shape->corners[4 * (size_t)t]]];
        *of = *of ? *of : ++count;
        shape->marks[t] = *of - 1;
    }
    free(part);
    free(number);
}

/* A box around a vertex. */
static void print_box(struct attack *a, char *out, size_t size)
{
    const double *p = a->positions + 3 * (size_t)dice_below(&a->dice, a->original.vertices);
    double half = a->diagonal * 0.3 * dice_unit(&a->dice) * dice_unit(&a->dice);
    snprintf(out, size, "--box=%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", p[0] - half, p[1] - half, p[2] - half,
             p[0] + half, p[1] + half, p[2] + half);
}

static void check_region(struct attack *a)
{
    char box[200], operands[2048], text[300];
    const char *error = ONE_OF(a, "0.5", "0.2", "0.1", "0.03"), *finer = ONE_OF(a, "0", "0.001", "0.02");
    uint32_t coarse = tetlod_level_for_error(a->info, strtod(error, NULL), TETLOD_NONE, TETLOD_MAX);
    print_box(a, box, sizeof box);
    snprintf(operands, sizeof operands, "%s --error %s %s --box-error %s -o %s", path_of(a, "mesh.tetlod"), error, box,
             finer, path_of(a, "region.vtk"));
    int status = run(a, "extract", operands);
    const char *about = said(a);
    if (status != 0 && !strstr(about, "none of its levels"))
        found(a, "extract", "exit status %d: %s | extract %s", status, about, operands);
    if (status != 0 || coarse == TETLOD_NONE || !strstr(about, "transition between them"))
        return; // the boxes' level is no finer
    const struct region_case c = {a->file, &a->original, a->field_of, a->component_of, domain_radius(a, coarse),
                                  a->falsehood.definite && !a->lossy, about};
    if (!region_holds(&c, path_of(a, "region.vtk"), text, sizeof text))
        found(a, "region", "%s | extract --error %s %s --box-error %s", text, error, box, finer);
}

static void check_stream(struct attack *a)
{
    uint32_t levels = a->info->level_count;
    falsehood_begin(&a->falsehood, a->info);
    a->falsehood.definite =
        strcmp(a->shape.kind, "box") == 0 || strcmp(a->shape.kind, "ball") == 0 || strcmp(a->shape.kind, "torus") == 0;
    check_index(a);
    for (uint32_t i = 0; i < 6 && a->shape.marks; i++)
        check_region(a);
    for (uint32_t i = 0; i < 4 && i < levels && !a->shape.marks; i++)
        check_level(a, i ? dice_below(&a->dice, levels) : 0);
    if (!a->shape.marks)
        check_verdicts(a);
    falsehood_end(&a->falsehood);
}

static void release(struct attack *a)
{
    tetlod_cursor_free(a->cursor);
    tetlod_close(a->file);
    oracle_finish(&a->original);
    for (uint32_t i = 0; i < a->original.value_count; i++)
        free(a->values[i]);
    free(a->positions);
    free(a->corners);
    free(a->part);
    free(a->bytes);
    shape_free(&a->shape);
}

static unsigned attack(const char *program, const char *folder, uint64_t seed)
{
    struct attack a = {.program = program, .folder = folder, .seed = seed,
                       .dice = {seed * UINT64_C(0x9e3779b97f4a7c15)}};
    shape_of_seed(&a.shape, &a.dice, seed);
    if (seed >= SHAPE_REGION_SEEDS)
        mark_parts(&a.shape);
    choose_options(&a);
    if (build(&a) && open_stream(&a) && take_original(&a))
        check_stream(&a);
    release(&a);
    return a.findings;
}

int main(int argc, char **argv)
{
    static const char *const files[] = {"mesh.vtk", "mesh.tetlod", "lie.tetlod", "region.vtk", "said"};
    struct attack names = {.folder = argc == 5 ? argv[2] : "."};
    unsigned findings = 0;
    if (argc != 5) {
        fprintf(stderr, "usage: attack PROGRAM FOLDER FIRST COUNT\n");
        return 2;
    }
    uint64_t first = strtoull(argv[3], NULL, 10), count = strtoull(argv[4], NULL, 10);
    for (uint64_t seed = first; seed < first + count; seed++)
        findings += attack(argv[1], argv[2], seed);
    for (size_t i = 0; i < sizeof files / sizeof *files && !getenv("KEEP"); i++)
        remove(path_of(&names, files[i]));
    return findings != 0;
}
