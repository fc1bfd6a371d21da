# SPDX-License-Identifier: BSD-3-Clause
"""Lines that keep wrong bytes in and hostile ones out: server, decoders, `verify`, page, clients (run_mutants.py)."""
from table import mutant


def one_of(folder, file):
    """Mutants of a file that one of its tests must see."""
    def add(name, test, source, old, new, why, more=()):
        mutant(name, source, old, new, why, '%s/%s %s' % (folder, file, test), more=more)
    return add


ACCESS, FAULTS, JOBS, PROTOCOL, MESHES, DEPLOY = (
    one_of('http', 'test_%s.py' % name) for name in ('access', 'faults', 'jobs', 'protocol', 'meshes', 'deploy'))
CHANGING = one_of('http', 'test_changing_files.py')

# ---- bytes under an immutable address

CHANGING('server: a new file is listed unchecked', 'test_a_day', 'server/store/catalogue.c',
    'if (scan->starting && bytes > scan->left)', 'if (bytes <= UINT64_MAX)', 'half a copy is not listed',
    more=(('server/store/dataset.c', 'if (atomic_load(&dataset->checked[i]) == version)', 'if (version)'),))
mutant('server: a part is not checked', 'server/store/dataset.c', 'if (atomic_load(&dataset->checked[i]) == version)',
    'if (version)', 'each part is held against its digest when it is first read', 'unit/test_site')
mutant('server: a part was good in any version', 'server/store/dataset.c',
    'if (atomic_load(&dataset->checked[i]) == version)', 'if (atomic_load(&dataset->checked[i]))',
    'what was written over is checked again', 'http/test_faults.py test_written_over', 'http/test_changing_files.py')
FAULTS('server: nobody writes while one reads', 'test_written_over_between_look_and_read', 'server/store/dataset.c',
    'return is_still(stored, fd, *version) ? TETLOD_OK : fail_changing(error);', 'return TETLOD_OK;',
    'bytes that were read belong to the version that was checked')
mutant('server: a file that has just changed is settled', 'server/store/open_files.c', 'if (age < 0 || age >= TICK)',
    'if (age >= 0 || age < 0)', 'a write in the tick of a rename is seen',
    'http/test_changing_files.py test_written_over_in_the_tick')
mutant('server: damage that a reader found is forgotten', 'server/store/dataset.c',
    'atomic_store(&stored->damaged, true);', '(void)stored;', 'the next scan takes off what is damaged',
    'unit/test_site')
mutant('server: what the cache holds of one file answers for another', 'server/jobs/stored.c',
    'dataset_file_number(stored->dataset),', 'UINT64_C(1),',
    'a copy that hangs or is damaged does not answer for a good one', 'http/test_faults.py test_a_file_that_hangs')

# ---- tokens

ACCESS('metrics: everything without token', 'test_the_address_of_metrics', 'server/routes/routes.c',
    'if (exchange->site->only_health && !route->health)', 'if (exchange->site->only_health && route->health && 0)',
    'that address answers three paths')
ACCESS('token: for everybody', 'test_token', 'server/http/access.c', 'return !differ;', 'return !differ || size == 5;',
    'a wrong token is refused')
ACCESS('token: a cookie by a name for all servers', 'test_cookies_of_several_servers', 'server/http/access.c',
    'hash_folded(hash));', 'hash_folded(hash) & 0);', 'the name of the cookie tells servers apart')
ACCESS('token: a cookie for the whole host', 'test_way_in', 'server/http/access.c',
    'site->base_path ? site->base_path : "/", site->secure_cookie', '"/", site->secure_cookie',
    'the cookie is scoped to the base path')
ACCESS('token: a cookie that is never secure', 'test_way_in', 'server/http/access.c',
    'site->secure_cookie ? "; Secure" : ""', '""', '--secure-cookie')
ACCESS('token: the bare base path leads nowhere', 'test_way_in', 'server/http/access.c',
    'if (base && size == base && strncmp(path, site->base_path, base) == 0)\n        return (size_t)snprintf',
    'if (base && size > 999)\n        return (size_t)snprintf', '/x?token= leads in')
ACCESS('token: guesses cost no time', 'test_wrong_tokens_cost_time', 'server/http/guesses.c', 'now + GUESS_SECONDS',
    'now', 'a wrong token waits')
ACCESS('token: guesses are not counted', 'test_wrong_tokens_cost_time', 'server/http/access.c',
    'metrics_count(exchange->site->metrics, METRIC_WRONG_TOKENS);', '', 'wrong tokens are a metric')
ACCESS('token: any number of guesses', 'test_wrong_tokens_cost_time', 'server/http/access.c',
    '|| guesses_admit(guesses, exchange->request->client))', '|| guesses)',
    'eight wrong tokens of a client wait at a time')
DEPLOY('varnish keeps what a token got', 'test_varnish_and_tokens', 'server/deploy/varnish.vcl',
    'if (req.http.Authorization || req.http.Cookie ~ "(^|;\\s*)tetlod_token_") {', 'if (req.http.Nothing) {',
    'caches in front pass tokens',
    more=(('server/deploy/varnish.vcl',
           '&& beresp.status == 200 &&\n        beresp.http.Cache-Control !~ "(?i)private|no-store") {',
           '&& beresp.status == 200) {'),))
mutant('token: answers are public', 'server/http/respond.c', 'access_private(exchange->policy) ? "private" : "public"',
    '"public"', 'answers to a token are private', 'http/test_access.py test_token')

# ---- requests

PROTOCOL('a target without a path', 'test_targets_without_a_path', 'server/routes/routes.c',
    '        return NULL;\n    const char *authority', '        return target;\n    const char *authority',
    'what begins with neither / nor a scheme is refused')
PROTOCOL('control characters in a target', 'test_targets_without_a_path', 'server/routes/routes.c',
    'if ((unsigned char)*c < 0x20 || *c == 0x7f)', 'if (*c == 0)', 'they reach no Location')
PROTOCOL('two Vary lines', 'test_one_vary', 'server/http/access.c', 'response_vary(response, "Origin");',
    'response_header_text(response, "Vary", "Origin");', 'one line')
PROTOCOL('a refusal of another length', 'test_connection_limits', 'server/server.c', 'sizeof body - 1, body);',
    'sizeof body - 3, body);', 'Content-Length of the 503')
mutant('a Location without room', 'server/http/message.h', 'enum { RESPONSE_HEADERS = 24, HEADER_TEXT = 8192,',
    'enum { RESPONSE_HEADERS = 24, HEADER_TEXT = 1024,', 'a long cells= has a Location',
    'http/test_cells_parameter.py',
    more=(('server/routes/routes.c', 'if (!response->headers_lost)', 'if (response->status)'),))
MESHES('a plus is itself', 'test_names_with_plus', 'server/http/params.c',
    "return find_value(text, name, ' ', out, capacity);", "return find_value(text, name, '+', out, capacity);",
    '+ is a space where the name is not found')
mutant('the client sends a plus', 'client-examples/python/tetlod/_sources.py', 'quote_via=urllib.parse.quote)',
    'quote_via=urllib.parse.quote_plus)', 'the Python client encodes it', 'http/test_meshes.py test_names_with_plus')

# ---- work for clients that are gone

JOBS('whoever has gone is worked for', 'test_clients_that_have_gone', 'server/jobs/obtain.c',
    'if (run->workers && (workers_stopping(run->workers) || cache_drop_unwanted(run->cache, run->entry))) {',
    'if (run->workers && workers_stopping(run->workers)) {', 'jobs are dropped when their last client leaves',
    more=(('server/jobs/obtain.c', '!workers_stopping(run->workers) && cache_wanted(run->cache, run->entry));',
           '!workers_stopping(run->workers));'),))
JOBS('one goes for all', 'test_one_of_two_clients_goes', 'server/store/cache.c',
    'return entry->references > (entry->listed ? 2U : 1U);', 'return entry->references > (entry->listed ? 3U : 2U);',
    'what another still waits for is made')
JOBS('one client has all jobs', 'test_jobs_of_one_client', 'server/jobs/obtain.c',
    'if (!entry && is_counted(site, request, job) &&', 'if (!entry && site->jobs_per_client == SIZE_MAX &&', '--jobs')
JOBS('stopping waits for the queue', 'test_stop_with_a_queue', 'server/jobs/obtain.c',
    'if (run->workers && (workers_stopping(run->workers) || cache_drop_unwanted(run->cache, run->entry))) {',
    'if (run->workers && cache_drop_unwanted(run->cache, run->entry)) {', 'stop within --drain + 1 s',
    more=(('server/jobs/obtain.c', '(!workers_stopping(run->workers) && cache_wanted(run->cache, run->entry));',
           'cache_wanted(run->cache, run->entry);'),
          ('server/server.c', 'LAST_SECONDS = 0.6;', 'LAST_SECONDS = 9;')))
JOBS('no time of grace', 'test_grace', 'server/server.c', 'nap(server->options.grace_seconds);', '',
    'connections are still accepted')
mutant('ready while it stops', 'server/routes/health.c', 'if (atomic_load(&site->draining)) {', 'if (0) {',
    '/readyz says 503', 'unit/test_site')

# ---- files that hang, clocks, sockets, memory

FAULTS('a file that hangs stops who reads others', 'test_a_file_that_hangs', 'server/server.c',
    'workers_relieve(site->readers, hanging);', '', 'other threads take the place of those that hang',
    more=(('server/server.c', 'workers_relieve(site->decoders, hanging);', ''),))
FAULTS('waiters of a file that hangs hear nothing', 'test_a_file_that_hangs', 'server/store/dataset.c',
    'return since > 0 && monotonic_seconds() - since > MAX_HANG;', 'return since < 0;', '503 after five seconds')
FAULTS('waits by the time of day', 'test_a_clock_that_was_set', 'src/util/clock.c',
    'pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);', '', 'waits by the monotonic clock',
    more=(('src/util/clock.c', 'clock_gettime(CLOCK_MONOTONIC, &now);', 'clock_gettime(CLOCK_REALTIME, &now);'),))
PROTOCOL('times beyond what clocks count with', 'test_long_times', 'server/server.c',
    'return given > 0 ? fmin(given, MAX_SECONDS) : otherwise;', 'return given > 0 ? given : otherwise;',
    '--scan 1e30 spins')
PROTOCOL('a socket is asked until it answers', 'test_sockets_of_others', 'server/net/listener.c',
    'if (why == ECONNREFUSED)', 'if (why)', 'only ECONNREFUSED removes a socket')
PROTOCOL('a socket of any mode', 'test_sockets_of_others', 'server/net/listener.c',
    'if (mode && chmod(path, mode) != 0) {', 'if (mode > 0777) {', '--socket-mode',
    more=(('server/net/listener.c', '(!mode || fchmod(listener->fd, mode) == 0)', 'mode <= 0777'),))
PROTOCOL('memory is not said', 'test_memory_is_said', 'server/server.c', '        say_memory(server);\n', '',
    'what --memory and --cache come to is logged')
mutant('memory of the machine alone', 'src/util/memory_limit.c', 'limit = found < limit ? found : limit;',
    '(void)found;', 'limits of the control group', 'unit/test_memory_limit')
MESHES("a region takes the whole stream's memory", 'test_memory_of_regions', 'src/stream/region.c',
    'TETLOD_TRY(room_take(cut->room, SMALL_BYTES + fixed, error));',
    'TETLOD_TRY(room_take(cut->room, SMALL_BYTES + 20 * fixed, error));', 'a small box needs little')
mutant('an entry that nobody finishes', 'server/jobs/obtain.c', 'if (!entry && has_free_pin(request))', 'if (!entry)',
    'nothing is begun that the request could not hold', 'unit/test_site',
    more=(('server/jobs/obtain.c', '    if (entry)\n        add_pin(request, cache, entry);',
           '    if (entry && has_free_pin(request))\n        add_pin(request, cache, entry);'),))
mutant('a list under the name of a later one', 'server/store/catalogue.c',
    '*out_digest = catalogue->digest;\n    pthread_mutex_unlock(&catalogue->lock);\n    *out_count = count;',
    '*out_digest = 0;\n    pthread_mutex_unlock(&catalogue->lock);\n    *out_digest = '
    'catalogue_digest(catalogue);\n    *out_count = count;', 'list and key are taken under one lock', 'unit/test_site')
mutant("the base path is the caller's text", 'server/rules.c', '*out = strdup(path);', '*out = (char *)(size_t)path;',
    'strings of options are copied', 'unit/test_server_options')
mutant("paths of streams are the caller's texts", 'server/store/catalogue.c',
    'catalogue->paths[i] = strdup(options->paths[i]);', 'catalogue->paths[i] = (char *)(size_t)options->paths[i];',
    'strings of options are copied', 'unit/test_server_options')
mutant("made answers' tags without the version", 'server/jobs/made.c', '-%s-" TETLOD_VERSION_STRING, dataset_info',
    '-%s-0", dataset_info', 'ETags of made answers name the version', 'unit/test_site')
JOBS('gauges: no queue', 'test_clients_that_have_gone', 'server/routes/health.c', '{"tetlod_queue_length"',
    '{"tetlod_queue"', 'gauges')
ACCESS('401 without a label', 'test_wrong_tokens_cost_time', 'server/http/metrics.c', '401, ', '',
    '401 under its own label')
ACCESS('SIGHUP changes nothing', 'test_reload', 'server/server.c',
    'return rules_set(server->site.access, options, error);\n}\n\n/* ---- stop',
    '(void)options, (void)error, (void)server; return TETLOD_OK;\n}\n\n/* ---- stop',
    'token, CORS, hosts are taken again')
ACCESS('any proxy is believed', 'test_forwarded_addresses', 'server/net/http.c', 'if (!peer_is_proxy(call->peer))',
    'if (!call->peer)', 'forwarded addresses behind a trusted proxy alone')

# ---- numbers that are not true

mutant('lengths between lengths', 'server/web/wasm/pictures.c', 'return field && field->values ? field : NULL;',
    'return field && !field->values ? field : NULL;', 'the length of a vector is that of interpolated components',
    'web/test_lengths.mjs')
mutant('verify: vertices of a rounded stream are not found', 'src/cli/against.c',
    '} else if (status == TETLOD_OK && !info->lossless) {', '} else if (status != TETLOD_OK && !info->lossless) {',
    'a rounded stream without --keep-order is measured', 'doors 1 24', 'cli/test_quantise.sh')
mutant('verify: values of cells of rounded streams', 'src/measure/same.c', 'if (a->values != b->values)', 'if (0)',
    'each tetrahedron has its own values', 'doors 1 24')
mutant('verify: a field of cells was lost', 'src/cli/cmd_verify.c',
    'if (tetlod_cell_field_index(info, input->cell_fields[f].name) == TETLOD_NONE)', 'if (f == TETLOD_NONE)',
    'a field of cells that was lost is found', 'cli/test_forged.py')
mutant('verify: a field of points was lost', 'src/cli/cmd_verify.c',
    'if (tetlod_field_index(info, input->fields[f].name) == TETLOD_NONE)', 'if (f == TETLOD_NONE)',
    'a field that was lost is found', 'cli/test_forged.py')
mutant('verify: times that differ', 'src/cli/against_steps.c', 'if (!isnan(times[s]) && stored[s] != times[s])',
    'if (0)', 'times of a series are held against the input', 'doors 1 24')
mutant('a file that is cut off has no level', 'src/stream/level_mesh.c',
    'if (status != TETLOD_OK && status != TETLOD_ERR_TRUNCATED)', 'if (status != TETLOD_OK)',
    'every whole level comes out of a file with values of cells', 'doors 1 24')
mutant('NAME:0 of a scalar is a copy', 'src/pipeline/control.c',
    'if (there && component == 0 && mesh->fields[whole].components == 1)', 'if (there && component == 99)',
    'its local bound is that of the field', 'cli/test_local_bound.py')
mutant('neighbours are weighed', 'src/mesh/nan_fill.c', 'if (i == 0 || own[i] != own[i - 1])', 'if (i < count)',
    'the plain mean of the neighbours', 'cli/test_nan_fill.py')

# ---- streams made to hurt

mutant('an exact band below the finest level', 'format/read/series.c',
    '!has_exact_bands_at_the_end(time, &index->info) ||', '', 'it has all vertices of the order',
    'golden/test_vectors.py check_exact_band')
mutant('python: an exact band below the finest level', 'client-examples/python/tetlod/reference_steps.py',
    "require(band['error'] or (level", 'require(True or (level', 'the same', 'golden/test_vectors.py check_exact_band')
mutant('plain bits beyond their number', 'format/common/coder.h', 'coder->bad |= (int)(value >> count);',
    'value = value >> count ? (1u << count) - 1 : value;', 'decoders do not differ',
    'golden/test_vectors.py check_invalid')
mutant('pages behind more cuts', 'format/common/cuts.h', 'MAX_CUTS = 64 /*', 'MAX_CUTS = 65 /*',
    'decoders do not differ', 'golden/test_vectors.py check_invalid')
mutant('python: pages behind more cuts', 'client-examples/python/tetlod/reference_pages.py', 'depth < MAX_CUTS',
    'depth <= MAX_CUTS', 'the same', 'golden/test_vectors.py check_invalid')
mutant('a level in pages with a digest', 'format/read/reader.c',
    ' || memcmp(whole->digest, none, DIGEST_SIZE) != 0', '', 'the same', 'golden/test_vectors.py check_invalid')
mutant('python: a level in pages with a digest', 'client-examples/python/tetlod/reference_pages.py',
    'frame[2] == bytes(16)', 'True', 'the same', 'golden/test_vectors.py check_invalid')
mutant('no field beside the geometry', 'format/coding/page_table.h', 'parts < 2 ? parts : 2;', '1;',
    'a page is in one range for those who look at the first field', 'unit/test_page_set')
mutant('a code that is the whole range', 'format/common/coder.c', 'coder->bad = coder->code == coder->range;', '',
    'the same', 'golden/test_vectors.py check_invalid')
mutant('python: plain bits beyond their number', 'client-examples/python/tetlod/reference.py',
    'value = self.code // width\n', 'value = min(self.code // width, (1 << count) - 1)\n', 'the same',
    'golden/test_vectors.py check_invalid')
mutant('python: a code that is the whole range', 'client-examples/python/tetlod/reference.py',
    'require(self.code < self.range,', 'require(self.code <= self.range,', 'the same',
    'golden/test_vectors.py check_invalid')
mutant('a packed index of any size', 'format/common/pack.c', 'PACKED_TABLE_PER_BYTE,\n', 'UINT32_MAX,\n',
    'limits go with the bytes', 'golden/test_vectors.py check_limits')
mutant('a packed section of any size', 'format/common/pack.c', 'is_within(plain, 0, PACKED_PER_BYTE, packed)',
    'is_within(plain, 0, UINT32_MAX, packed)', 'the same', 'golden/test_vectors.py check_limits')
mutant('any number of vertices', 'format/coding/index.c', 'NUMBERS_FREE, NUMBERS_PER_BYTE, bytes))',
    'UINT64_MAX, NUMBERS_PER_BYTE, bytes))', 'the same', 'golden/test_vectors.py check_limits')
mutant('any number of levels', 'format/coding/index.c', 'LEVEL_ROWS_FREE, LEVEL_ROWS_PER_BYTE, info->bytes))',
    'UINT64_MAX, LEVEL_ROWS_PER_BYTE, info->bytes))', 'the same', 'golden/test_vectors.py check_limits')
mutant('any number of steps', 'format/coding/step_code.c',
    'return is_within(rows, STEP_ROWS_FREE, STEP_ROWS_PER_BYTE, bytes);', 'return rows > 0 || bytes > 0;', 'the same',
    'golden/test_vectors.py check_limits')
mutant('any number of labels', 'format/coding/record.c',
    'return recorder->labels <= labels_of(recorder, column, bytes);', 'return bytes < UINT64_MAX;', 'the same',
    'unit/test_codec')
mutant('any memory', 'format/read/reader.c', 'return most < file->options.max_bytes ? most : file->options.max_bytes;',
    'return most > 0 ? UINT64_MAX : 0;', 'the same', 'unit/test_cursor')
mutant('verify believes: bounds', 'src/cli/verify_index.c', 'TETLOD_TRY(check_bounds(file, finest, error));', '',
    'bounds of the index are those of what it holds', 'cli/test_forged.py')
mutant('verify believes: ranges', 'src/cli/verify_index.c', 'TETLOD_TRY(check_ranges(file, finest, error));', '',
    'ranges of the index are those of what it holds', 'cli/test_forged.py')
mutant('verify believes: degenerate', 'src/cli/verify_index.c',
    'if (!is_near(info->degenerate_tets, found.degenerate, found.doubtful))', 'if (0)',
    'counts of the index are those of what it holds', 'cli/test_forged.py')
mutant('verify believes: inverted', 'src/cli/verify_index.c',
    'if (found.oriented && !is_near(info->inverted_tets, found.inverted, 5 * found.doubtful))', 'if (0)',
    'counts of the index are those of what it holds', 'cli/test_forged.py')
mutant('verify believes: ranges of cells', 'src/cli/verify_index.c',
    'if (range[0] == declared[0] && range[1] == declared[1])', 'if (range[0] <= range[1])',
    'ranges of the index are those of what it holds', 'cli/test_forged.py')
mutant('verify believes: unused points', 'src/cli/against.c', 'if (a->input->unused_points != info->unused_points)',
    'if (0)', 'counts of the index', 'cli/test_forged.py')
mutant('verify believes: times that do not rise', 'src/cli/against_steps.c',
    '"steps %u and %u have the same time, %.9g", s - 1, s,', '"%u %u %.9g", s - 1, s,', 'times', 'cli/test_forged.py')
mutant('verify believes: ranges of steps', 'src/cli/against_steps.c', 'if (range->of_group == of_groups &&',
    'if (range->of_group != of_groups && range->room < 0 &&', 'ranges', 'cli/test_forged.py')
mutant('integers of cells beyond 2^53', 'format/read/cell_values.c', 'else if (!whole_of(bits, width, &out[i]))',
    'else if (!whole_of(bits, width, &out[i]) && bits == 7)', 'none is rounded in silence', 'cli/test_forged.py')
mutant('bytes behind a packed part', 'format/common/pack.c', 'if (coder.at < coder.end)\n',
    'if (coder.at > coder.end)\n', 'they are zero', 'cli/test_forged.py')
mutant('quality is damage', 'src/cli/cmd_verify.c', 'return v->poor_levels ? EXIT_QUALITY : EXIT_DONE;',
    'return v->poor_levels ? EXIT_INVALID : EXIT_DONE;', 'a status of its own', 'cli/test_forged.py')
mutant('units reach the terminal', 'src/stream/metadata.c',
    'return unit && tetlodi_plain_text(unit, strlen(unit)) ? unit : "";', 'return unit ? unit : "";',
    'control characters', 'cli/test_forged.py')

# ---- the page and the clients

ELEMENT, STREAM = one_of('web', 'test_element.mjs'), one_of('web', 'test_stream.mjs')
ELEMENT('element: what opens is not ended', 'mounts_at_random', 'server/web/page/viewer.js',
    '    if (this.#closing.signal.aborted) this.stream.close(); // while the answer was on its way\n', '',
    'no worker is left',
    more=(('server/web/page/viewer.js', '{ ...options, signal: this.#closing.signal, on:', '{ ...options, on:'),
          ('server/web/page/viewer.js', '    this.stream?.close();\n', '')))
ELEMENT('element: a late failure closes the new source', 'an_old_source', 'server/web/page/element.js',
    '    } catch (error) {\n      if (viewer !== this.#viewer) return;', '    } catch (error) {',
    'nothing is heard of an old source')
ELEMENT('element: needs a browser to be imported', 'it_can_be_imported', 'server/web/page/element.js',
    'extends (globalThis.HTMLElement ?? class {})', 'extends HTMLElement', 'import in node')
mutant('page: a percent sign in a name', 'server/web/page/opened.js',
    'from.name ?? decoded(new URL(from, location).pathname)',
    'decodeURIComponent(from.name ?? new URL(from, location).pathname)', 'fin_1%.tetlod',
    'web/test_files.mjs a_file_with_a_percent_sign')
mutant('page: exploded names as they are', 'server/web/page/catalogue.js', ".replaceAll('%', '%25')}`", '}`',
    'names with #, ? and %', 'web/test_files.mjs a_folder_on_a_static_host')
STREAM('frames: only what has changed', 'framesBesideOtherPictures', 'server/web/client/stream.js',
    'await this.show(spec, { whole: true });', 'await this.show(spec);', 'surfaces have triangles')
STREAM('frames: what was shown before is gone', 'framesBesideOtherPictures', 'server/web/client/stream.js',
    'await this.show(before, { whole: true });', 'await this.show(null);', 'leaving the loop shows it again')
STREAM('a host may ask for a day', 'waitsNoLongerThanAMinute', 'server/web/client/network.js',
    'Math.min(wait, MAX_DELAY)', 'wait', 'Retry-After has an upper bound')
mutant('no notices', 'server/web/notices.mjs', 'new Map([...used, colours]', 'new Map([colours]',
    'licences of what is bundled', 'web/test_package.mjs itsNotices')
mutant('types: no tag', 'client-examples/web/stream.d.ts', '  started: null;\n', '', 'events have types',
    'web/test_package.mjs resolvesByItsName')

mutant('package: an import that is not declared', 'server/web/page/ray_mapper.js', "import { mat4 } from 'gl-matrix';",
    "import 'd3-color';\nimport { mat4 } from 'gl-matrix';", 'package.json names what the page imports, as gl-matrix',
    'web/test_package.mjs itsNotices')

# ---- reading and building

mutant('weld: values are not hashed', 'src/io/services/weld.c', '    uint64_t values = hash_values(w->mesh, v);\n',
    '    uint64_t values = 0;\n', 'many values at one place take no quadratic time', 'cli/test_io_vtkxml.py')
mutant('weld: points without a place', 'src/io/services/weld.c',
    'if (isnan(box[0]) || isnan(box[1]) || isnan(box[2]))', 'if (0)', 'the same for NaN', 'cli/test_io_vtkxml.py')
mutant('encoding does not heed cancel', 'format/write/writer.c',
    'return !in->progress || in->progress(in->progress_opaque, done)\n',
    'return !in->progress || in->progress(in->progress_opaque, done) || done < 2\n', 'cancel ends it',
    'unit/test_library')
mutant('metadata are looked at last', 'src/pipeline/build.c',
    'if (!wrong && !json_text_is_object(options->metadata, strlen(options->metadata)))',
    'if (!wrong && !options->metadata)', 'before the contraction', 'unit/test_library')
mutant('a PVD file without escapes', 'src/cli/sample_series.c', 'put_escaped(&put, name);', 'put_text(&put, name);',
    'XML', 'cli/test_sample_convert.py')
mutant('threads are cut without a word', 'src/cli/build_request.c',
    'parse_unsigned("threads", value, 0, PARALLEL_MAX_THREADS,', 'parse_unsigned("threads", value, 0, UINT32_MAX,',
    'more than 64 are refused', 'cli/test_everyday.py')
mutant('openapi: a status less', 'server/api/tables.py', '[400, 401, 405, 413,', '[400, 401, 413,',
    'every answer is described', 'http/test_protocol.py test_methods')
