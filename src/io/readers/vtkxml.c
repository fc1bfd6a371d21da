/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Reading the XML files of VTK, versions 0.1 to 2.x: unstructured (VTU), structured, rectilinear and image grids (VTS,
 * VTR, VTI) in any number of pieces, the parallel forms of these, whose pieces are files, and files of blocks (VTM,
 * VTPD, VTPC) and of steps in time (PVD).
 */
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/io/readers/readers.h"
#include "src/io/services/pieces.h"
#include "src/io/services/time_steps.h"
#include "src/io/readers/vtkxml_document.h"
#include "src/util/array.h"

bool vtkxml_sniff(const unsigned char *bytes, size_t size)
{
    size_t start = size >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0 ? 3 : 0, head = size < 1024 ? size : 1024;
    struct text text = {(const char *)bytes + start, (const char *)bytes + head};
    for (struct text word = text_word(&text); word.at != word.end; word = text_word(&text))
        if (word.end - word.at >= 8 && memcmp(word.at, "<VTKFile", 8) == 0)
            return true;
    return false;
}

static bool is_structured(const struct vtkxml_document *document)
{
    return document->kind == VTKXML_STRUCTURED || document->kind == VTKXML_RECTILINEAR ||
           document->kind == VTKXML_IMAGE;
}

static enum tetlod_status read_piece(const struct vtkxml_document *document, const struct vtkxml_piece *piece,
                                     struct blocks *out, const struct io_input *input, struct io_report *report,
                                     struct tetlod_error *error)
{
    struct block *block;
    if (piece->source)
        return io_read_named(out, input, piece->source, report, error);
    TETLOD_TRY(blocks_add(out, &block, error));
    return vtkxml_read_piece(document, piece, 0, 1, block, report, error);
}

/* A structured piece that a parallel form names is one block, whatever the file is made of. */
static enum tetlod_status read_grid(const struct vtkxml_document *document, struct blocks *out,
                                    const struct io_input *input,
                                    struct io_report *report, struct tetlod_error *error)
{
    int64_t(*extents)[6] = array_new(document->piece_count, sizeof *extents);
    size_t first = out->count;
    enum tetlod_status status = extents ? TETLOD_OK : tetlodi_fail_nomem(error, "the extents",
                                                                         document->piece_count * 48);
    for (size_t p = 0; p < document->piece_count && status == TETLOD_OK; p++) {
        const struct vtkxml_piece *piece = &document->pieces[p];
        status = read_piece(document, piece, out, input, report, error);
        memcpy(extents[p], piece->extent, sizeof piece->extent);
        if (status != TETLOD_OK)
            break;
        const uint32_t *dims = out->at[out->count - 1].dims;
        bool fits = out->count == first + p + 1;
        for (int d = 0; d < 3; d++)
            fits = fits && dims[d] == (uint64_t)(piece->extent[2 * d + 1] - piece->extent[2 * d] + 1);
        if (!fits)
            status = tetlodi_fail(error, TETLOD_ERR_MESH, "piece %zu is not of the extent that is given for it", p);
    }
    if (status == TETLOD_OK && document->piece_count > 1)
        status = vtkxml_join(out, first, (const int64_t(*)[6])extents, document->extent, report, error);
    free(extents);
    return status;
}

static enum tetlod_status read_numbered(void *opaque, uint32_t piece, struct blocks *out, const struct io_input *input,
                                        struct io_report *report, struct tetlod_error *error)
{
    const struct vtkxml_document *document = opaque;
    return read_piece(document, &document->pieces[piece], out, input, report, error);
}

/* The only piece of a file, of which several programs read some. */
struct ranges {
    const struct vtkxml_document *document;
    uint32_t count;
};

static enum tetlod_status read_range(void *opaque, uint32_t range, struct blocks *out, const struct io_input *input,
                                     struct io_report *report, struct tetlod_error *error)
{
    const struct ranges *ranges = opaque;
    struct block *block;
    (void)input;
    TETLOD_TRY(blocks_add(out, &block, error));
    return vtkxml_read_piece(ranges->document, ranges->document->pieces, range, ranges->count, block, report, error);
}

static enum tetlod_status read_pieces(const struct vtkxml_document *document, struct blocks *out,
                                      const struct io_input *input, struct io_report *report,
                                      struct tetlod_error *error)
{
    if (document->piece_count == 0)
        return tetlodi_fail(error, TETLOD_ERR_MESH, "there is no Piece in it");
    if (is_structured(document))
        return read_grid(document, out, input, report, error);
    struct ranges ranges = {document, 1};
    struct piece_list list = {(uint32_t)document->piece_count, read_numbered, (void *)(uintptr_t)document};
    if (document->piece_count == 1 && vtkxml_has_ranges(document, document->pieces))
        ranges.count = pieces_ranges(input->options, document->pieces->cells);
    if (ranges.count > 1)
        list = (struct piece_list){ranges.count, read_range, &ranges};
    return pieces_read(&list, out, input, report, error);
}

/* The times of a collection, and which of them is asked for; *has_time: whether it has any. */
static enum tetlod_status choose_time(const struct vtkxml_document *document, const struct io_input *input,
                                      double *time,
                                      bool *has_time, struct io_report *report, struct tetlod_error *error)
{
    struct time_steps steps = {0};
    enum tetlod_status status = TETLOD_OK;
    for (size_t p = 0; p < document->part_count && status == TETLOD_OK; p++)
        if (document->parts[p].has_time)
            status = time_steps_add(&steps, document->parts[p].time, error);
    *has_time = steps.count > 0;
    if (status == TETLOD_OK && steps.count)
        status = time_steps_choose(&steps, input->options, report, error);
    if (status == TETLOD_OK && steps.count)
        *time = report->time;
    time_steps_fini(&steps);
    return status;
}

static enum tetlod_status fail_block(const struct vtkxml_document *document, const char *name,
                                     struct tetlod_error *error)
{
    char known[160] = "";
    size_t length = 0;
    for (size_t p = 0; p < document->part_count && length + 40 < sizeof known; p++) {
        size_t size = strlen(document->parts[p].path) - 1;
        size = size < 37 ? size : 37;
        known[length] = ' ';
        memcpy(known + length + 1, document->parts[p].path + 1, size ? size - 1 : 0);
        length = strlen(known);
    }
    return tetlodi_fail(error, TETLOD_ERR_MESH, "has no block '%.60s' with a file; there are:%.160s", name, known);
}

/* Whether a file has blocks with names itself. */
static bool has_blocks(const char *path)
{
    static const char *const extensions[] = {".vtm", ".vtmb", ".vtpd", ".vtpc"};
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; dot && i < sizeof extensions / sizeof *extensions; i++)
        if (strcmp(dot, extensions[i]) == 0)
            return true;
    return false;
}

static enum tetlod_status read_file(void *opaque, uint32_t number, struct blocks *out, const struct io_input *input,
                                    struct io_report *report, struct tetlod_error *error)
{
    const char *const *files = opaque;
    return io_read_named(out, input, files[number], report, error);
}

/* The part as a whole where it is in the block that is asked for; if no part is, those blocks in it. */
static enum tetlod_status read_parts(const struct vtkxml_document *document, struct blocks *out,
                                     const struct io_input *input, struct io_report *report, struct tetlod_error *error)
{
    const struct io_read_options *options = input->options;
    struct io_read_options whole = options ? *options : (struct io_read_options){0};
    const char *wanted = whole.block;
    struct io_input inner = *input;
    double time = 0;
    bool has_time, is_here = false;
    TETLOD_TRY(choose_time(document, input, &time, &has_time, report, error));
    report->names_blocks = true;
    for (size_t p = 0; p < document->part_count && wanted && !is_here; p++)
        is_here = block_path_has(document->parts[p].path, wanted);
    whole.block = NULL;
    inner.options = !wanted || is_here ? &whole : options;
    const char **files = array_new(document->part_count, sizeof *files);
    struct piece_list list = {0, read_file, files};
    if (!files)
        return tetlodi_fail_nomem(error, "the files", document->part_count * sizeof *files);
    for (size_t p = 0; p < document->part_count; p++) {
        const struct vtkxml_part *part = &document->parts[p];
        if ((!has_time || (part->has_time && part->time == time)) &&
            (!wanted || (is_here ? block_path_has(part->path, wanted) : has_blocks(part->file))))
            files[list.count++] = part->file;
    }
    enum tetlod_status status = list.count ? pieces_read(&list, out, &inner, report, error)
                                           : fail_block(document, wanted ? wanted : "", error);
    free(files);
    return status;
}

enum tetlod_status vtkxml_read(struct blocks *out, const struct io_input *input, struct io_report *report,
                               struct tetlod_error *error)
{
    struct vtkxml_document document;
    enum tetlod_status status;
    TETLOD_TRY_DONE(vtkxml_parse(&document, input, report, error));
    if (document.kind == VTKXML_POLYGONS && input->depth)
        report->flat_blocks++;
    else if (document.kind == VTKXML_POLYGONS)
        status = tetlodi_fail(error, TETLOD_ERR_MESH, "is PolyData, which holds polygons; only volumes can be read");
    else if (document.kind == VTKXML_MULTIBLOCK || document.kind == VTKXML_COLLECTION)
        status = read_parts(&document, out, input, report, error);
    else
        status = read_pieces(&document, out, input, report, error);
done:
    vtkxml_document_fini(&document);
    return status;
}
