/* SPDX-License-Identifier: BSD-3-Clause */
/* A stage of one part, whose result is packed by the function that unpacks it (parcel.h). */
#include "src/cells/border_help.h"

#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/parcel.h"

/* What a member has of the stage. */
struct finding {
    const struct work_share *share;
    struct tetmesh mesh; /* without fields */
    struct simplify_options options;
    uint8_t turned;
    enum tetlod_status heard; /* of a helper: has it room for these? */
    struct piece_border border;
    bool found; /* here */
    const struct border_meanwhile *meanwhile; /* NULL: this member helps */
    struct tetlod_error *error;
};

static void pass_input(struct finding *finding)
{
    struct channel channel = {finding->share, TETLOD_OK};
    mesh_pass(&channel, &finding->mesh, NULL);
    CHANNEL_VALUE(&channel, finding->turned);
    CHANNEL_VALUE(&channel, finding->options.boundary_limit);
    CHANNEL_VALUE(&channel, finding->options.boundary_least);
    finding->heard = channel.status;
}

/* Bytes of which nearly all are zero: as numbers of eight, of which many take one byte. */
static void pass_flags(struct channel *channel, uint8_t **io_flags, size_t count)
{
    const size_t words = (count + sizeof(uint64_t) - 1) / sizeof(uint64_t);
    uint64_t *copy = channel->share->leads ? array_zero(words, sizeof *copy) : NULL;
    if (copy)
        memcpy(copy, *io_flags, count);
    else if (channel->share->leads)
        channel->status = TETLOD_ERR_NOMEM;
    if (channel->status == TETLOD_OK)
        CHANNEL_WORDS(channel, copy, words, 1);
    if (channel->share->leads)
        free(copy);
    else
        *io_flags = (uint8_t *)copy;
}

static void pass_border(struct channel *channel, struct piece_border *border, const struct tetmesh *mesh)
{
    pass_flags(channel, &border->flags, mesh->vertex_count);
    pass_flags(channel, &border->boundary_faces, mesh->tet_count);
    CHANNEL_WORDS(channel, border->most, mesh->vertex_count, 1);
    CHANNEL_VALUE(channel, border->degenerate_tets);
    CHANNEL_VALUE(channel, border->inverted_tets);
    CHANNEL_VALUE(channel, border->folded_tets);
}

static enum tetlod_status pass(struct finding *finding, struct buffer *bytes, bool packs)
{
    struct parcel parcel;
    parcel_begin(&parcel, bytes, packs);
    pass_border(&parcel.channel, &finding->border, &finding->mesh);
    return parcel_end(&parcel, "the boundary", finding->error);
}

/* For the others, of which the one that leads alone asks for it. */
static enum tetlod_status put_border(struct finding *finding, uint32_t part)
{
    struct buffer bytes = {0};
    enum tetlod_status status = finding->meanwhile ? TETLOD_OK : pass(finding, &bytes, true);
    if (status == TETLOD_OK)
        status = finding->share->put(finding->share->opaque, part, bytes.bytes, bytes.size, finding->error);
    buffer_fini(&bytes);
    return status;
}

static enum tetlod_status find(void *opaque)
{
    struct finding *finding = opaque;
    uint32_t part;
    if (finding->heard != TETLOD_OK) // also of one that would only keep the mesh
        return tetlodi_fail_nomem(finding->error, "the boundary", 16 * (uint64_t)finding->mesh.tet_count);
    if (finding->share->take(finding->share->opaque, &part, NULL)) {
        TETLOD_TRY(piece_border_find(&finding->border, &finding->mesh, finding->turned, &finding->options,
                                     finding->error));
        TETLOD_TRY(put_border(finding, part));
        finding->found = true;
    }
    return finding->meanwhile ? finding->meanwhile->work(finding->meanwhile->opaque) : TETLOD_OK;
}

static enum tetlod_status get_border(struct finding *finding)
{
    struct buffer bytes = {0};
    TETLOD_TRY(finding->share->get(finding->share->opaque, 0, SIZE_MAX, &bytes.bytes, &bytes.size, finding->error));
    enum tetlod_status status = pass(finding, &bytes, false);
    buffer_fini(&bytes);
    return status;
}

struct kept_mesh border_kept(const struct work_share *share, const struct tetmesh *mesh)
{
    struct kept_mesh kept = {0};
    if (mesh && work_has_lasting_helpers(share)) {
        kept.mesh = *mesh;
        kept.mesh.field_count = 0;
    }
    return kept;
}

enum tetlod_status border_share(const struct work_share *share, struct piece_border *out, const struct tetmesh *mesh,
                                bool turned, const struct simplify_options *options,
                                const struct border_meanwhile *meanwhile, struct tetlod_error *error)
{
    struct finding finding = {.share = share, .mesh = border_kept(share, mesh).mesh, .options = *options,
                              .turned = turned, .meanwhile = meanwhile, .error = error};
    enum work_call call = CALL_BORDER;
    TETLOD_TRY(share->call(share, &call, &share, error));
    finding.share = share;
    pass_input(&finding);
    enum tetlod_status status = work_share_run(share, 1, NULL, NULL, find, &finding, error);
    if (status == TETLOD_OK && !finding.found)
        status = get_border(&finding);
    share->end(share->opaque);
    *out = finding.border;
    return status;
}

enum tetlod_status border_help(const struct work_share *share, unsigned threads, struct kept_mesh *out,
                               struct tetlod_error *error)
{
    struct finding finding = {.share = share, .options = {.threads = threads}, .error = error};
    pass_input(&finding);
    enum tetlod_status status = work_share_run(share, 1, NULL, NULL, find, &finding, error);
    share->end(share->opaque);
    piece_border_fini(&finding.border);
    kept_mesh_fini(out);
    *out = (struct kept_mesh){finding.mesh, finding.found};
    return status;
}
