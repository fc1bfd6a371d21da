/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Work that several programs do together, on one machine or on many, in stages of so many parts each. A part is done
 * by one of them, which gives its result as bytes. Which member does a part is left to chance, so its bytes must not
 * depend on that.
 *
 * A member that leads has the mesh, and all results of a stage when all parts are done. The others, its helpers, wait
 * for its calls, each of which begins a stage of all members, or of a crew of them; and it passes on what the stage
 * works on.
 */
#ifndef TETLOD_WORK_SHARE_H
#define TETLOD_WORK_SHARE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "format/tetlod.h"
#include "src/util/buffer.h"

/* What a part works on, where that is the part's own: for a helper that takes it. Of the program that leads; one thread
 * beside those that work calls it. ERR_NOMEM. */
struct work_input {
    enum tetlod_status (*pack)(void *opaque, uint32_t part, struct buffer *out, struct tetlod_error *error);
    void *opaque;
};

/* What a helper is called for; CALL_PIECES: to read some; CALL_MEMORY: to hear how much it may take, an uint64_t, and
 * whether that is less than a build needs, an uint8_t. */
enum work_call { CALL_OVER, CALL_PIECES, CALL_MEMORY, CALL_BORDER, CALL_CELLS, CALL_ROOT, CALL_SAMPLES, CALL_PAGES };

/* What CALL_BORDER and CALL_SAMPLES begin so many do at most, the one that leads included: each of them has to be sent
 * the whole mesh, and to carry it from level to level, which takes a tenth of the time that all samples take. */
enum { WORK_FEW = 5 };

static inline bool work_is_of_few(enum work_call call)
{
    return call == CALL_BORDER || call == CALL_SAMPLES;
}

struct work_share {
    uint32_t members; /* that work, about: it may be more or fewer */
    bool apart;       /* of a crew that measures: its members are called for nothing else that follows, and the one that
                         leads takes no part. It may go on with other stages before it settles this one */
    bool leads;       /* this one has the mesh, and goes on alone when nothing is left to share */
    bool serves;      /* it takes no parts of stages that all work on: what one can do for all, another one does */
    bool writes;      /* the stream: one that leads */
    bool keeps_parts; /* for members that come later: what one does alone is a part as well */
    /* Of one that has the mesh, before the first stage: do those that led before have the same one, and options that
     * are the same? The hash tells. NULL: there are no others. ERR_IO names a file. */
    enum tetlod_status (*same)(void *opaque, uint64_t hash, struct tetlod_error *error);
    /* The next stage begins. Its parts are taken in that order (NULL: ascending); the order and the input (NULL: there
     * is none, or this one helps) are borrowed until the end. ERR_IO, ERR_NOMEM, or with what another member has
     * failed. */
    enum tetlod_status (*begin)(void *opaque, uint32_t parts, const uint32_t *order, const struct work_input *input,
                                struct tetlod_error *error);
    /* A part that nobody has begun; false if there is none. A helper also gets its input, in a buffer that is empty, or
     * NULL for a stage without. Any thread may call it, and put. */
    bool (*take)(void *opaque, uint32_t *out_part, struct buffer *out_input);
    enum tetlod_status (*put)(void *opaque, uint32_t part, const void *bytes, size_t size, struct tetlod_error *error);
    /* Waits until all parts are done. `status` is what this member's have come to, and *error why. *out_again: a member
     * has died, and take() gives what it has left. What one member fails with, all do. */
    enum tetlod_status (*settle)(void *opaque, enum tetlod_status status, bool *out_again, struct tetlod_error *error);
    /* A part of a stage that is settled, or its first bytes, `enough` at least, until the next one begins; not for
     * helpers. The caller frees the block. */
    enum tetlod_status (*get)(void *opaque, uint32_t part, size_t enough, unsigned char **out, size_t *size,
                              struct tetlod_error *error);
    /* The stage is over: its parts may go. */
    void (*end)(void *opaque);
    /* Processor time of this stage that every member spends, however many there are; NULL: nobody asks. */
    void (*spent_alone)(void *opaque, double seconds);
    /* The leader sends *io_call, those that it is for wait for it; NULL: there are no others. *out, the share itself or
     * borrowed of it, is the crew: the members that the stage is of. ERR_CANCELLED: a member has failed; ERR_IO names a
     * file. */
    enum tetlod_status (*call)(const struct work_share *share, enum work_call *io_call, const struct work_share **out,
                               struct tetlod_error *error);
    /* Behind a call: bytes of the one that leads come to those that it called; where they are NULL they are dropped. */
    void (*pass)(void *opaque, void *bytes, size_t size);
    void *opaque;
};

/* A stage from its begin until it is settled: `work` does what parts it can take, and is called again for those that a
 * member which died has left. The caller ends the stage in any case. */
TETLOD_CHECKED enum tetlod_status work_share_run(const struct work_share *share, uint32_t parts, const uint32_t *order,
                                                 const struct work_input *input,
                                                 enum tetlod_status (*work)(void *opaque), void *opaque,
                                                 struct tetlod_error *error);

/* Is there a program that works on what this one passes on, or does this one work on what it gets? */
static inline bool work_has_helpers(const struct work_share *share)
{
    return share && share->call && share->leads;
}

static inline bool work_helps(const struct work_share *share)
{
    return share && share->call && !share->leads;
}

/* Are there helpers that last from the begin to the end? */
static inline bool work_has_lasting_helpers(const struct work_share *share)
{
    return work_has_helpers(share) && !share->keeps_parts;
}

#endif
