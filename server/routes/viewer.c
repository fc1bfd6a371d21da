/* SPDX-License-Identifier: BSD-3-Clause */
/* The page and the files that it loads. */
#include "server/routes/viewer.h"

#include <stdio.h>
#include <string.h>

#include "server/http/conditions.h"
#include "server/http/respond.h"
#include "server/routes/handlers.h"

/* Nothing from elsewhere runs here or is asked, but streams of the origins that the operator named. The page's workers
 * and its WebAssembly need what is said of them; blob: is for pictures and workers that it makes itself. */
static void content_policy(const struct site *site, struct response *response)
{
    response_header(response, "Content-Security-Policy",
                    "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; img-src "
                    "'self' data: blob:; "
                    "object-src 'none'; base-uri 'none'; form-action 'none'; connect-src 'self'%s",
                    site->stream_origins ? site->stream_origins : "");
}

enum outcome handle_asset(struct exchange *exchange, const struct embedded_file *asset)
{
    struct response *response = exchange->response;
    unsigned have = 0;
    for (int c = 0; c < CODINGS; c++)
        have |= asset->coded[c].bytes ? 1u << c : 0;
    enum coding coding = coding_choose(request_header(exchange->request, "Accept-Encoding"), have);
    const struct embedded_bytes *coded = &asset->coded[coding];
    response->status = 200;
    response->media_type = asset->media_type;
    response->kind = BODY_BYTES;
    response->bytes = coded->bytes;
    response->size = (size_t)(coded->end - coded->bytes);
    if (coding)
        response_header_text(response, "Content-Encoding", coding_name(coding));
    snprintf(response->etag, sizeof response->etag, "\"%s%s%s\"", asset->hash, coding ? "-" : "", coding_name(coding));
    response_vary(response, "Accept-Encoding");
    content_policy(exchange->site, response);
    response_header_text(response, "X-Content-Type-Options", "nosniff");
    link_description(exchange);
    if (strncmp(asset->path, "/worker-",
                8) == 0) // it obeys the policy that came with it, which the next start may change
        response_header_text(response, "Cache-Control", "private, max-age=60");
    else if (asset->named_by_content)
        cache_forever(exchange);
    else
        cache_revalidate(response);
    return ANSWERED;
}

/* Which stream the page shows, and how, it reads from its own address. */
enum outcome handle_view(struct exchange *exchange)
{
    const struct embedded_file *page = assets_find("/view/");
    if (page)
        return handle_asset(exchange, page);
    response_problem(exchange->response, 404, exchange->request->target,
                     "this program was built without the page (WEB=0)");
    return ANSWERED;
}
