/* SPDX-License-Identifier: BSD-3-Clause */
#include "src/report/plot.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/put.h"
#include "src/util/utf8_clean.h"

/* Okabe and Ito's colours, which differ for every kind of colour vision; dashes for black and white. */
static const struct style {
    const char *colour, *dashes, *text;
} styles[TETLOD_MEASURES] = {
    [TETLOD_MAX] = {"#0072b2", "none", "max (certified)"},
    [TETLOD_SAMPLED] = {"#d55e00", "7 3", "sampled"},
    [TETLOD_RMS] = {"#009e73", "2 3", "rms"},
    [TETLOD_PREDICTED] = {"#8a5c7d", "10 3 2 3", "predicted"},
};

enum { WIDTH = 1040, HEIGHT = 470, PANEL_WIDTH = 420, PANEL_HEIGHT = 320, PANEL_TOP = 60, MAX_DECADES = 12 };

/* A logarithmic axis over whole decades: exponents of ten at its ends. */
struct axis {
    int least, greatest;
    double from, to; /* where its ends are drawn */
};

struct plot {
    const struct tetlod_info *info;
    uint32_t field;
    const struct plot_steps *steps; /* instead, of a picture over time */
    struct put put;
};

static double error_of(const struct plot *plot, uint32_t level, int measure)
{
    return plot->info->levels[level].errors[(size_t)plot->field * TETLOD_MEASURES + (size_t)measure];
}

static bool drawn(double error)
{
    return isfinite(error) && error > 0;
}

static double abscissa(const struct plot *plot, uint32_t level, bool bytes)
{
    const struct tetlod_level *at = &plot->info->levels[level];
    return bytes ? (double)at->end : at->tets;
}

static double place(const struct axis *axis, double value)
{
    double t = (log10(value) - axis->least) / (axis->greatest - axis->least);
    return axis->from + (axis->to - axis->from) * fmin(1, fmax(0, t));
}

static struct axis make_axis(double least, double greatest, double from, double to)
{
    struct axis axis = {(int)floor(log10(least) + 1e-9), (int)ceil(log10(greatest) - 1e-9), from, to};
    axis.greatest += axis.greatest == axis.least;
    return axis;
}

static struct axis error_axis(const struct plot *plot)
{
    double least = INFINITY, greatest = 0;
    for (uint32_t k = 0; k < plot->info->level_count; k++)
        for (int m = 0; m < TETLOD_MEASURES; m++) {
            double error = error_of(plot, k, m);
            least = drawn(error) ? fmin(least, error) : least;
            greatest = drawn(error) ? fmax(greatest, error) : greatest;
        }
    if (greatest == 0) // no error anywhere
        least = greatest = 0.01;
    struct axis axis = make_axis(least, greatest, PANEL_TOP + PANEL_HEIGHT, PANEL_TOP);
    if (axis.greatest - axis.least > MAX_DECADES)
        axis.least = axis.greatest - MAX_DECADES; // what is below lies on the edge
    return axis;
}

static struct axis size_axis(const struct plot *plot, bool bytes, double from)
{
    double least = INFINITY, greatest = 1;
    for (uint32_t k = 0; k < plot->info->level_count; k++) {
        least = fmin(least, fmax(1, abscissa(plot, k, bytes)));
        greatest = fmax(greatest, abscissa(plot, k, bytes));
    }
    return make_axis(fmin(least, greatest), greatest, from, from + PANEL_WIDTH);
}

static void put_label(struct plot *plot, double x, double y, const char *anchor, const char *text)
{
    put_format(&plot->put, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n", x, y, anchor, text);
}

static void put_line(struct plot *plot, double x1, double y1, double x2, double y2, const char *colour)
{
    put_format(&plot->put, "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\"/>\n", x1, y1, x2, y2,
               colour);
}

/* A power of ten as a percentage of the range, or as a count with a unit. */
static void decade_text(int exponent, bool percent, char out[24])
{
    static const char *const units[] = {"", "k", "M", "G", "T"};
    if (percent)
        snprintf(out, 24, exponent < -6 ? "%.0e %%" : "%.12g %%", pow(10, exponent + 2));
    else
        snprintf(out, 24, "%.0f%s", pow(10, exponent - exponent / 3 * 3), exponent < 15 ? units[exponent / 3] : "T+");
}

/* Lines at the decades with their labels, fainter ones at 2 to 9 of each. */
static void put_grid(struct plot *plot, const struct axis *axis, bool vertical, const struct axis *other)
{
    for (int exponent = axis->least; exponent <= axis->greatest; exponent++)
        for (int digit = 1; digit <= (exponent < axis->greatest ? 9 : 1); digit++) {
            double at = place(axis, digit * pow(10, exponent));
            const char *colour = digit == 1 ? "#b0b0b0" : "#ececec";
            char text[24];
            if (vertical)
                put_line(plot, other->from, at, other->to, at, colour);
            else
                put_line(plot, at, other->from, at, other->to, colour);
            if (digit > 1)
                continue;
            decade_text(exponent, vertical, text);
            put_label(plot, vertical ? other->from - 8 : at, vertical ? at + 4 : other->from + 18,
                      vertical ? "end" : "middle", text);
        }
}

static bool has_measure(const struct plot *plot, int measure)
{
    bool found = false;
    for (uint32_t k = 0; k < plot->info->level_count; k++)
        found |= drawn(error_of(plot, k, measure));
    return found;
}

static void put_curve(struct plot *plot, const struct axis *x, const struct axis *y, bool bytes, int measure)
{
    if (!has_measure(plot, measure))
        return;
    put_format(&plot->put, "<polyline class=\"%s\" fill=\"none\" stroke=\"%s\" stroke-width=\"2\" "
                           "stroke-dasharray=\"%s\" points=\"",
               tetlod_measure_name((enum tetlod_measure)measure), styles[measure].colour, styles[measure].dashes);
    for (uint32_t k = 0; k < plot->info->level_count; k++)
        if (drawn(error_of(plot, k, measure)))
            put_format(&plot->put, "%.2f,%.2f ", place(x, fmax(1, abscissa(plot, k, bytes))),
                       place(y, error_of(plot, k, measure)));
    put_text(&plot->put, "\"/>\n");
}

static void put_panel(struct plot *plot, bool bytes, double left)
{
    struct axis x = size_axis(plot, bytes, left), y = error_axis(plot);
    put_grid(plot, &x, false, &y);
    put_grid(plot, &y, true, &x);
    for (int m = TETLOD_MEASURES; m-- > 0;) // the certified one on top
        put_curve(plot, &x, &y, bytes, m);
    put_label(plot, left + PANEL_WIDTH / 2.0, PANEL_TOP + PANEL_HEIGHT + 40, "middle", bytes ? "bytes" : "tetrahedra");
}

static void put_legend(struct plot *plot)
{
    double x = 90, y = HEIGHT - 18;
    for (int m = 0; m < TETLOD_MEASURES; m++) {
        if (!has_measure(plot, m))
            continue;
        put_format(&plot->put,
                   "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\" stroke-width=\"2\" "
                   "stroke-dasharray=\"%s\"/>\n",
                   x, y - 4, x + 40, y - 4, styles[m].colour, styles[m].dashes);
        put_label(plot, x + 48, y, "start", styles[m].text);
        x += 190;
    }
}

static void put_title(struct plot *plot, const char *tag, const char *id, const char *field)
{
    put_text(&plot->put, tag);
    put_escaped(&plot->put, id);
    put_text(&plot->put, ": error of ");
    put_escaped(&plot->put, field);
    put_text(&plot->put, ", % of its range");
}

static enum tetlod_status write_picture(struct plot *plot, const char *id, const char *field,
                                        void (*put_content)(struct plot *plot),
                                        const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    char *names[2] = {strdup(id), strdup(field)};
    enum tetlod_status status = TETLOD_OK;
    if (!names[0] || !names[1])
        status = tetlodi_fail_nomem(error, "the picture", strlen(id));
    if (status == TETLOD_OK)
        status = put_init(&plot->put, sink, false, error);
    if (status == TETLOD_OK) {
        utf8_clean(names[0]);
        utf8_clean(names[1]);
        put_format(&plot->put,
                   "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" viewBox=\"0 0 %d %d\" "
                   "font-family=\"sans-serif\" font-size=\"13\" fill=\"#222222\">\n",
                   WIDTH, HEIGHT, WIDTH, HEIGHT);
        put_title(plot, "<title>", names[0], names[1]);
        put_format(&plot->put, "</title>\n<rect width=\"%d\" height=\"%d\" fill=\"#ffffff\"/>\n", WIDTH, HEIGHT);
        put_title(plot, "<text x=\"90\" y=\"32\" font-size=\"17\">", names[0], names[1]);
        put_text(&plot->put, "</text>\n");
        put_content(plot);
        put_text(&plot->put, "</svg>\n");
        status = put_finish(&plot->put);
    }
    free(names[0]);
    free(names[1]);
    return status;
}

static void put_levels(struct plot *plot)
{
    put_panel(plot, false, 90);
    put_panel(plot, true, 90 + PANEL_WIDTH + 90);
    put_legend(plot);
}

enum tetlod_status plot_write(const struct tetlod_info *info, uint32_t field, const char *id,
                              const struct tetlodi_sink *sink, struct tetlod_error *error)
{
    struct plot plot = {.info = info, .field = field};
    return write_picture(&plot, id, info->fields[field].name, put_levels, sink, error);
}

/* ---- over time */

static const char *const band_colours[] = {"#0072b2", "#d55e00", "#009e73", "#8a5c7d", "#996600", "#000000"};
enum { TIME_LEFT = 90, TIME_RIGHT = WIDTH - 90 };

static double time_place(const struct plot_steps *steps, double time)
{
    double first = steps->times[0], span = steps->times[steps->step_count - 1] - first;
    return TIME_LEFT + (span > 0 ? (time - first) / span : 0.5) * (TIME_RIGHT - TIME_LEFT);
}

/* Lines at round times, about eight. */
static void put_times(struct plot *plot, const struct axis *y)
{
    const struct plot_steps *steps = plot->steps;
    double first = steps->times[0], last = steps->times[steps->step_count - 1],
           decade = pow(10, floor(log10((last - first) / 8)));
    double step = last > first ? decade * ((last - first) / 8 > 5 * decade ? 10 : (last - first) / 8 > 2 * decade ? 5
                                           : 2) : 1;
    for (double k = ceil(first / step - 1e-9); k * step <= last + 1e-9 * step; k++) {
        char text[24];
        put_line(plot, time_place(steps, k * step), y->from, time_place(steps, k * step), y->to, "#ececec");
        snprintf(text, sizeof text, "%.6g", k * step + 0.0); // not -0
        put_label(plot, time_place(steps, k * step), y->from + 18, "middle", text);
        if (!(last > first) || k + 1 == k)
            break;
    }
    put_label(plot, (TIME_LEFT + TIME_RIGHT) / 2.0, y->from + 40, "middle", "time");
}

static void put_steps_curve(struct plot *plot, const struct axis *y, uint32_t band, int measure)
{
    const struct plot_steps *steps = plot->steps;
    const double *errors = (measure == TETLOD_SAMPLED ? steps->sampled : steps->rms) + (size_t)band * steps->step_count;
    put_format(&plot->put, "<polyline class=\"%s\" fill=\"none\" stroke=\"%s\" stroke-width=\"2\" "
                           "stroke-dasharray=\"%s\" points=\"",
               tetlod_measure_name((enum tetlod_measure)measure), band_colours[band % (sizeof band_colours /
                                                                                       sizeof *band_colours)],
               styles[measure].dashes);
    for (uint32_t s = 0; s < steps->step_count; s++)
        if (drawn(errors[s]))
            put_format(&plot->put, "%.2f,%.2f ", time_place(steps, steps->times[s]), place(y, errors[s]));
    put_text(&plot->put, "\"/>\n");
}

static struct axis steps_axis(const struct plot_steps *steps)
{
    double least = INFINITY, greatest = 0;
    for (size_t i = 0; i < (size_t)steps->band_count * steps->step_count; i++) {
        least = drawn(steps->rms[i]) ? fmin(least, steps->rms[i]) : least;
        greatest = fmax(greatest, steps->bands[i / steps->step_count].error);
    }
    least = fmin(least, greatest);
    return make_axis(fmax(least, greatest * 1e-6), greatest, PANEL_TOP + PANEL_HEIGHT, PANEL_TOP);
}

static void put_steps(struct plot *plot)
{
    const struct plot_steps *steps = plot->steps;
    const struct axis y = steps_axis(steps), x = {.from = TIME_LEFT, .to = TIME_RIGHT};
    put_grid(plot, &y, true, &x);
    put_times(plot, &y);
    for (uint32_t b = 0; b < steps->band_count; b++) {
        const char *colour = band_colours[b % (sizeof band_colours / sizeof *band_colours)];
        char text[32];
        snprintf(text, sizeof text, "%.4g %%", 100 * steps->bands[b].error);
        put_line(plot, x.from, place(&y, steps->bands[b].error), x.to, place(&y, steps->bands[b].error), colour);
        put_label(plot, x.to + 8, place(&y, steps->bands[b].error) + 4, "start", text);
        put_steps_curve(plot, &y, b, TETLOD_RMS);
        put_steps_curve(plot, &y, b, TETLOD_SAMPLED);
    }
    put_label(plot, x.from, HEIGHT - 18, "start",
              "a colour for each band: thin, what it promises; dashed, the largest error at samples of each step; "
              "dotted, the RMS");
}

enum tetlod_status plot_write_steps(const struct plot_steps *steps, const char *field, const char *id,
                                    const struct tetlodi_sink *sink,
                                    struct tetlod_error *error)
{
    struct plot plot = {.steps = steps};
    return write_picture(&plot, id, field, put_steps, sink, error);
}
