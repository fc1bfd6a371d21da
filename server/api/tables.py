# SPDX-License-Identifier: BSD-3-Clause
"""What the description of the HTTP interface says beside the routes (server/routes/routes.def): parameters, headers,
answers and schemas. describe.py makes OpenAPI of both."""

COUNT = {'type': 'integer', 'minimum': 0}
POSITIVE = {'type': 'integer', 'minimum': 1}
INTEGER = {'type': 'integer'}
NUMBER = {'type': 'number'}
TEXT = {'type': 'string'}
FLAG = {'type': 'boolean'}


def parameter(where, description, schema, name=None, required=False, **more):
    """Its name is its key where no other is given. What a path names is always required."""
    needed = {'required': True} if required or where == 'path' else {}
    return {'name': name, 'in': where, 'description': description, 'schema': schema, **needed, **more}


def header(description, schema, required=False):
    return {'description': description, **({'required': True} if required else {}), 'schema': schema}


def ref(name, kind='schemas'):
    return {'$ref': '#/components/%s/%s' % (kind, name)}


def about(description, schema):
    return {**schema, 'description': description}


def several(items, count=None, least=None):
    limits = {'minItems': count, 'maxItems': count} if count else {'minItems': least} if least else {}
    return {'type': 'array', 'items': items, **limits}


def record(members):
    """An object; a name that ends in ? may be missing."""
    required = [name for name in members if not name.endswith('?')]
    return {'type': 'object', **({'required': required} if required else {}),
            'properties': {name.rstrip('?'): schema for name, schema in members.items()}}


def answer(description, content=(), headers=(), also='', format=None, status='200'):
    """What a route answers: media types, or a schema of JSON; names of HEADERS; names of further RESPONSES; the key of
    the parameter {format}."""
    types = {'application/json': {'schema': content}} if isinstance(content, dict) else {one: {} for one in content}
    return {'status': status, 'description': description, 'headers': list(headers), 'content': types,
            'also': also.split(), 'format': format}


# By a key, which is the name where nothing else is given. Of several with one name, a route says which.
PARAMETERS = {
    'id': parameter('path', "The stream's file name without .tetlod", {'type': 'string', 'maxLength': 128},
                    example='fin'),
    'cid': parameter('path',
                     'Its content id, or that of one of its topology groups: what is under it never changes',
                     {'type': 'string', 'pattern': '^[0-9a-f]{32}$'}),
    'topology': parameter('query',
                          'Describes this topology group of a series whose mesh changes: its levels, times and '
                          'bands. Without it, and for 0, the whole stream', COUNT, example=0),
    'q': parameter('query', "The question, as `tetlod help ask` says", {'type': 'string', 'maxLength': 511},
                   required=True,
                   example='mean(Pressure)'),
    'within': parameter('query', "How wide the interval may be, in the answer's units; or a percentage of the field's "
                        'range (of the volume; of the volume times the range)', {'type': 'string', 'default': '1%'}),
    'limit': parameter('query', 'At most so many streams, in the order of their ids; without it all of them',
                       {'type': 'integer', 'minimum': 0, 'maximum': 10000}),
    'after': parameter('query', 'Only streams whose ids come behind this one: the last one of the page before',
                       {'type': 'string', 'maxLength': 128}),
    'level': parameter('path', 'A level; 0 is the coarsest', COUNT, example=0),
    'from': parameter('path', 'The coarser level', COUNT, example=0),
    'to': parameter('path', 'The finer level', COUNT, example=1),
    'fields': parameter('query',
                        "Only these fields' data, names separated by commas, 8191 bytes at most (none: "
                        'geometry alone)', TEXT),
    'error': parameter('query', "The largest error, a fraction of the field's range: 0.01 or 1%", TEXT,
                       example='0.01'),
    'abs_error': parameter('query', "The largest error in the field's own units", {'type': 'number', 'minimum': 0}),
    'budgetLevel': parameter('query', 'The level itself', COUNT, name='level'),
    'tets': parameter('query', 'At most so many tetrahedra; K, M, G may follow', TEXT),
    'bytes': parameter('query', 'At most so many bytes of the stream; K, M, G may follow', TEXT),
    'errorField': parameter('query',
                            'The field that the error is about (default: all that the stream was built to control)',
                            TEXT, name='field'),
    'measure': parameter('query', 'The measure of the error',
                         {'enum': ['max', 'sampled', 'rms', 'predicted'], 'default': 'max'}),
    'meshFormat': parameter('query', 'The format of the mesh', {'enum': ['vtu', 'vtk', 'tetlod'], 'default': 'vtu'},
                            name='format'),
    'pathMeshFormat': parameter('path', 'The format of the mesh', {'enum': ['vtu', 'vtk', 'tetlod']}, name='format',
                                example='vtu'),
    'surfaceFormat': parameter('path', 'The format of the surface', {'enum': ['vtp', 'stl', 'glb']}, name='format',
                               example='vtp'),
    'isoField': parameter('query', "A scalar field, or NAME:0 for a vector's component", TEXT, name='field',
                          required=True, example='Pressure'),
    'value': parameter('query', 'The value on the isosurface', NUMBER, required=True, example=2.5),
    'origin': parameter('query', 'A point of the plane', several(NUMBER, 3), required=True, example=[0, 0, 1],
                        explode=False, style='form'),
    'normal': parameter('query', "The plane's normal", several(NUMBER, 3), required=True, example=[0, 0, 1],
                        explode=False, style='form'),
    'range': parameter('header', 'One range of bytes', TEXT, name='Range', example='bytes=0-1023'),
    'cells': parameter('query',
                       'Values of tetrahedra that the file has: names of cell fields, separated by commas, or '
                       'all. Without it: none.', TEXT),
    'boxes': parameter('query',
                       'Finer in this box: x0,y0,z0,x1,y1,z1, the least corner first; up to 16 of them, '
                       "separated by ';'", TEXT, name='box'),
    'box_error': parameter('query', 'The largest error in the boxes, of the kind that error or abs_error is. '
                           'Without it: the finest level, of a stream in pages the finest that is in pages',
                           {'type': 'string'}, example='0.1%'),
    'regionBoxes': parameter('query',
                             'Finer in this box: x0,y0,z0,x1,y1,z1, the least corner first; up to 16 of them, '
                             "separated by ';'", TEXT, name='box', required=True, example='0,0,0,0.5,0.5,0.5'),
    'box_level': parameter('query', 'The level in the boxes, finer than the other', POSITIVE, required=True,
                           example=3),
    'meshFileFormat': parameter('path', 'The format of the mesh', {'enum': ['vtu', 'vtk']}, name='format',
                                example='vtu'),
    'band': parameter('path', 'A band of a series in time: values within an error; 0 is the coarsest', COUNT,
                      example=0),
    'group': parameter('path',
                       'A step group, which is eight steps that are stored together: 0 has the steps 0 to 7 of '
                       'the stream that the content id names', COUNT, example=0),
    'stepNumber': parameter('path',
                            'A step in time, counted in the stream that the content id names: from the first '
                            'step of its topology group', COUNT, name='step', example=1),
    'step': parameter('query',
                      'A step in time, counted through all topology groups, with `error` or `abs_error` and in '
                      'place of all other choices: the coarsest band within the error', COUNT, example=1),
    'time': parameter('query', 'The step whose time is nearest, in place of `step`', NUMBER, example=0.5),
    'stepFields': parameter('query',
                            'Names of fields, separated by commas: of their frames only; without it, of all '
                            'fields that have steps', TEXT, name='fields', example='Pressure'),
}

# That some answers have.
HEADERS = {
    'ETag': header('The entity tag, of each coding its own', TEXT, required=True),
    'Cache-Control': header('immutable under a content id', TEXT),
    'Location': header('Where to go on, relative to the address of the request', TEXT, required=True),
    'Server-Timing': header('Whether it was cached and what it took to make', TEXT),
    'Tetlod-Level': header('The level', COUNT, required=True),
    'Tetlod-Vertices': header('Its vertices', COUNT, required=True),
    'Tetlod-Tets': header('Its tetrahedra', COUNT, required=True),
    'Tetlod-Error': header('Its errors by measure, each the largest over the controlled fields: max=0.01, '
                           'sampled=0.008', TEXT, required=True),
    'Tetlod-Uncontrolled': header('Fields that the stream does not control, and the largest measured error of '
                                  'one of them: fields=9, sampled=0.319; not sent where there is none', TEXT),
    'Retry-After': header('Seconds', COUNT, required=True),
    'Content-Range': header('The range sent, or the size after */', TEXT, required=True),
    'Tetlod-Box-Level': header('The level in the boxes', INTEGER, required=True),
    'Tetlod-Box-Error': header("That level's errors, as Tetlod-Error", TEXT, required=True),
    'Tetlod-Transition-Tets': header('Tetrahedra of the transition between the two levels', INTEGER, required=True),
    'Tetlod-Transition-Error': header('measured=E: the true largest error in the transition, of the controlled '
                                      'fields, a fraction of the range; no error is certified there. Local '
                                      'bounds are raised so that they hold there, too. Of a stream in pages '
                                      'max=E: a certified bound', TEXT, required=True),
    'Tetlod-Band': header('The band', COUNT),
    'Tetlod-Step': header('The step, counted through all topology groups', COUNT),
    'Tetlod-Topology': header('The topology group that the step is in; 0 where the mesh does not change', COUNT),
    'Tetlod-Time': header('Its time', NUMBER),
    'Accept-Ranges': header('bytes, where Range is heeded', TEXT),
    'Content-Disposition': header('A file name for saving the answer', TEXT),
    'Link': header('Leads to this description: rel="service-desc"', TEXT),
    'Content-Security-Policy': header('What the page may load', TEXT),
    'X-Content-Type-Options': header('nosniff', TEXT),
    'Allow': header('The methods that every path knows', TEXT, required=True),
    'WWW-Authenticate': header('Bearer, with 401', TEXT),
    'Set-Cookie': header('The token, for this server alone', TEXT),
}

# That any answer may have.
ANY_HEADERS = {
    'Server': header('tetlod', TEXT),
    'X-Request-Id': header('That of the request, or a new one: it is in the access log', TEXT),
    'Cache-Control': header('How long caches may keep the answer', TEXT),
    'Vary': header('The headers of the request that the answer depends on', TEXT),
    'Content-Encoding': header('gzip, zstd or br, where Accept-Encoding allows it', TEXT),
    'Cross-Origin-Resource-Policy': header('Whether pages of other origins may use the answer', TEXT),
    'Access-Control-Allow-Origin': header('The origin whose pages may read the answer', TEXT),
    'Access-Control-Expose-Headers': header('The headers that these pages may read', TEXT),
    'Timing-Allow-Origin': header('The origin whose pages may see how long it took', TEXT),
}

# Of JSON.
SCHEMAS = {
    'Problem': record({'title': TEXT, 'status': INTEGER, 'detail': TEXT, 'instance?': TEXT,
                       'meshes?': several(TEXT), 'cid?': several(TEXT), 'fields?': several(TEXT),
                       'formats?': several(TEXT), 'measures?': several(TEXT), 'parameters?': several(TEXT),
                       'cells?': several(TEXT)}),
    'Catalogue': record({'count': about('Of all streams', COUNT),
                         'next?': about('The page behind this one, relative to this address', TEXT),
                         'meshes': several(record({'id': TEXT, 'cid': TEXT, 'vertices': COUNT, 'tets': COUNT,
                                                   'bytes': COUNT, 'levels': COUNT,
                                                   'series': about('Whether it has steps in time', FLAG),
                                                   'fields': several(TEXT), 'links': record({'self': TEXT})}))}),
    'Answer': record({'question': TEXT, 'lower': NUMBER, 'upper': NUMBER, 'unit': TEXT,
                      'bound': {'enum': ['exact', 'certified']},
                      'answer?': about('Of a question with a comparison', {'enum': ['yes', 'no', 'unknown']}),
                      'level?': about('That answered; without it what lies before the levels did', COUNT),
                      'tets?': COUNT, 'bytes': about('That such a client reads', COUNT), 'of_bytes': COUNT,
                      'time?': about('Of the step that was asked about', NUMBER)}),
    'Stream': record({'id': TEXT, 'cid': {'type': 'string', 'pattern': '^[0-9a-f]{32}$'}, 'vertices': COUNT,
                      'tets': COUNT, 'bytes': COUNT, 'bounds': several(several(NUMBER, 3), 2), 'lossless': FLAG,
                      'pages?': about('Of all levels in pages', COUNT),
                      'first_paged_level?': about('From there on levels are in pages', COUNT),
                      'degenerate_tets': COUNT, 'inverted_tets': COUNT, 'unused_points': COUNT,
                      'fields': several(ref('Field')), 'levels': several(ref('Level'), least=1),
                      'links': record({'self': TEXT, 'mesh': TEXT, 'prefix?': TEXT, 'level': TEXT, 'surface?': TEXT,
                                       'isosurface?': TEXT, 'slice?': TEXT, 'records': TEXT, 'stream': TEXT,
                                       'group?': TEXT, 'step?': TEXT, 'stepSurface?': TEXT, 'stepIsosurface?': TEXT,
                                       'stepSlice?': TEXT}),
                      'cell_fields': about("Values of the original's tetrahedra, which those of every level have.",
                                           several(ref('CellField'))), 'series?': ref('Series'),
                      'topologies?': about('The topology groups of a series whose mesh changes: steps over one '
                                           'mesh each. The first is this stream; the others are streams of '
                                           'their own inside its file, with a content id of their own.',
                                           several(record({'steps': POSITIVE, 'times': several(NUMBER), 'cid': TEXT,
                                                       'offset': COUNT, 'bytes': {'type': 'integer', 'minimum': 64}}))),
                      'metadata': about('What the program that built the stream says about it',
                                        {'type': 'object', 'additionalProperties': True})}),
    'Field': record({'name': TEXT, 'components': POSITIVE, 'type': {'enum': ['float32', 'float64']},
                     'range': several(NUMBER, 2), 'controlled': FLAG,
                     'bounds?': about('The field whose error this one bounds at every point of every level '
                                      '(build --local-bound).', TEXT)}),
    'Level': record({'level': COUNT, 'vertices': COUNT, 'tets': COUNT,
                     'bytes': about('Length of the prefix that decodes to it', COUNT),
                     'offset': about('Of its own first byte', COUNT),
                     'domain_error': about('How far the boundary has moved at most, a fraction of the '
                                           'diagonal; null: not known', {'type': ['number', 'null'], 'minimum': 0}),
                     'errors': about('By field, by measure; a measure that is not known is left out',
                                     {'type': 'object',
                                      'additionalProperties': {**record({'max?': {'type': 'number', 'minimum': 0},
                                                                     'sampled?': {'type': 'number', 'minimum': 0},
                                                                     'rms?': {'type': 'number', 'minimum': 0},
                                                                     'predicted?': {'type': 'number', 'minimum': 0}}),
                                          'additionalProperties': False}})}),
    'CellField': record({'name': TEXT, 'components': POSITIVE,
                         'type': {'enum': ['float32', 'float64', 'int8', 'int16', 'int32', 'int64']},
                         'range': several(NUMBER, 2),
                         'region': about('Its numbers tell regions, whose interfaces every level keeps.', FLAG),
                         'error?': about("The values are rounded: the greatest difference from the original's, in "
                                         'its units.', NUMBER)}),
    'Series': about('Of a series in time: its steps, the fields that have steps, and the bands that they are '
                    'stored in',
                    record({'steps': POSITIVE,
                            'relative_to': about("What the bands' errors are fractions of: a field's range "
                                                 "over all steps, or each step's own", {'enum': ['series', 'step']}),
                            'times': several(NUMBER),
                            'fields': several(record({'name': TEXT,
                                                  'range': about('Over all steps', several(NUMBER, 2))})),
                            'cell_fields': about('Fields of cells that have values at every step; others are known at '
                                                 'the first one alone',
                                                 several(record({'name': TEXT, 'range': several(NUMBER, 2)}))),
                            'bands': several(record({'error': about('A fraction of the range that '
                                                                    '`relative_to` names; 0: exact', NUMBER),
                                                 'level': COUNT, 'vertices': COUNT, 'tets': COUNT,
                                                 'bytes': about('Of all steps', COUNT), 'largest_error': NUMBER})),
                            'displacement': about('The field that moves the points, or null',
                                                  {'type': ['string', 'null']})})),
}

# Of routes that answer with stored bytes, files of the program, levels or steps.
STORED = ['ETag', 'Cache-Control', 'Accept-Ranges', 'Server-Timing']
FILE = ['ETag', 'Link', 'Content-Security-Policy', 'X-Content-Type-Options']
MESH = ['Tetlod-Level', 'Tetlod-Vertices', 'Tetlod-Tets', 'Tetlod-Error']
STEP = ['Tetlod-Band', 'Tetlod-Step', 'Tetlod-Topology', 'Tetlod-Time']
REGION = ['Tetlod-Box-Level', 'Tetlod-Box-Error', 'Tetlod-Transition-Tets', 'Tetlod-Transition-Error']
PARTIAL = 'Partial OutOfRange NotModified BadRequest NotFound '
LEVEL_FILE = STORED + ['Content-Disposition'] + MESH + ['Tetlod-Uncontrolled']
STEP_FILE = STORED + ['Content-Disposition'] + MESH + STEP
TETLOD, VTU, VTK = 'application/vnd.tetlod', 'application/vnd.vtk.vtu', 'application/vnd.vtk'
SURFACES = ('model/stl', 'application/vnd.vtk.vtp', 'model/gltf-binary')
TRIANGLES = 'Triangles, with the fields as vertex attributes in VTP and glTF'

# Which routes.def names.
ANSWERS = {
    'page': answer('HTML', ['text/html'], FILE, 'NotModified NotFound'),
    'description': answer('OpenAPI 3.1', ['application/json'], FILE, 'NotModified'),
    'alive': answer('It does', record({'status': {'const': 'alive'}})),
    'ready': answer('It does', record({
        'status': {'const': 'ready'}, 'meshes': COUNT,
        'unreadable?': about('Files and folders that the last scan could not look at; their streams are served as they '
                             'were.', COUNT),
        'open_files?': about('Streams whose files are open; the others are opened when they are read.', COUNT)})),
    'metrics': answer('Text format 0.0.4', ['text/plain'], (), 'NotFound'),
    'catalogue': answer('All streams', ref('Catalogue'), ['ETag', 'Accept-Ranges', 'Server-Timing', 'Link'],
                        'NotModified BadRequest'),
    'stream_info': answer("The stream's index", ref('Stream'), ['ETag', 'Accept-Ranges', 'Server-Timing'],
                          'NotModified BadRequest NotFound'),
    'ask': answer('An interval that holds the answer', ref('Answer'), ['ETag', 'Accept-Ranges', 'Server-Timing'],
                  'NotModified BadRequest NotFound TooLarge'),
    'choice': answer('The level that was chosen', ['text/plain'], ['Location'] + MESH + ['Tetlod-Uncontrolled'] + STEP,
                     'BadRequest NotFound TooFine', status='303'),
    'prefix': answer('Header, index, and the frames of levels 0 to the chosen one. With `time` or `step`: header, '
                     "index, the geometry of the levels up to the band's, the section TIME, and of each field the step "
                     'group that has the step', [TETLOD], STORED + MESH + ['Tetlod-Uncontrolled'] + STEP,
                     PARTIAL + 'TooFine'),
    'stream': answer('Its bytes', [TETLOD], STORED + ['Content-Disposition'], PARTIAL),
    'frames': answer('Frames of the stream', [TETLOD], STORED, PARTIAL),
    'mesh': answer('The mesh', [VTU, VTK, TETLOD], LEVEL_FILE, PARTIAL + 'TooLarge', 'pathMeshFormat'),
    'region': answer('The mesh', [VTU, VTK], STORED + ['Content-Disposition'] + MESH + REGION, PARTIAL + 'TooLarge',
                     'meshFileFormat'),
    'surface': answer(TRIANGLES, SURFACES, LEVEL_FILE, PARTIAL + 'TooLarge', 'surfaceFormat'),
    'step_mesh': answer("The mesh of the band's level with the values of the step", [VTU, VTK], STEP_FILE,
                        PARTIAL + 'TooLarge', 'meshFileFormat'),
    'step_surface': answer(TRIANGLES, SURFACES, STEP_FILE, PARTIAL + 'TooLarge', 'surfaceFormat'),
}


def response(description, headers=(), content=('text/plain',), **more):
    """`headers`: names of HEADERS, or headers by name."""
    named = headers if isinstance(headers, dict) else {name: ref(name, 'headers') for name in headers}
    return {'description': description, **({'headers': named} if named else {}),
            **({'content': {one: {} for one in content}} if content else {}), **more}


def problem(description, headers=(), also=(), **more):
    made = response(description, headers, also, **more)
    return {**made, 'content': {'application/problem+json': {'schema': ref('Problem')}, **made.get('content', {})}}


# The status of each is in describe.py.
RESPONSES = {
    'NotFound': problem('No such mesh, a content id that is not current, or no such path; a page for clients that '
                        'accept text/html', ['Content-Security-Policy'], ['text/html']),
    'BadRequest': problem('A parameter is missing, unknown or not valid; the answer lists what is'),
    'TooFine': problem("No level or band is within that error, because the stream is lossy; the detail names the "
                       "finest one's error"),
    'TooLarge': problem("More than the server's memory (--memory) takes; the stored bytes are always served"),
    'Later': problem('The server has too much to do or is about to stop', ['Retry-After']),
    'OutOfRange': problem('The range lies outside the answer', ['Content-Range']),
    'Partial': response('The range', ['Content-Range'], ['*/*']),
    'NotModified': response('The entity tag is current', ['ETag'], ()),
    'Options': response('The answer to OPTIONS, at every path', {
        'Allow': ref('Allow', 'headers'),
        'Access-Control-Allow-Methods': header('The methods that pages of the allowed origin may use', TEXT),
        'Access-Control-Allow-Headers': header('The headers that they may send', TEXT),
        'Access-Control-Max-Age': header('Seconds for which a browser need not ask again', INTEGER)}, ()),
    'Entered': response('The token was given as ?token=TOKEN: it became a cookie, and Location is the address without '
                        'it', ['Location', 'Set-Cookie']),
    'WithSlash': response('The base path without its last slash: Location is the one with it', ['Location']),
    'Refused': problem('Refused, whatever the path is. 400: not HTTP. 401: the token is missing or wrong. 405: not '
                       'GET, HEAD or OPTIONS. 413: with a body. 414, 431: too long. 421: Host is not a name of this '
                       'machine, on its own address. 429: too many answers of this client are being made, or too many '
                       'wrong tokens came from it. 500: the stream is damaged. 503: later. 505: not HTTP/1', {
                           'Allow': header('The methods that every path knows, with 405', TEXT),
                           'WWW-Authenticate': ref('WWW-Authenticate', 'headers'),
                           'Retry-After': header('Seconds, with 429 and 503', COUNT)},
                       **{'x-statuses': [400, 401, 405, 413, 414, 421, 429, 431, 500, 503, 505]}),
}

# At all addresses that are no routes.
FILES = response('The page and what it loads, at the other addresses', FILE, ['*/*'])
