# SPDX-License-Identifier: BSD-3-Clause
"""The description is valid OpenAPI 3.1, and the server does what it says: every operation is asked, well and badly, so
that every status and every header that it names is seen. (described.py holds every answer of all HTTP tests against
it.)"""
import os
import re
import subprocess
import urllib.parse

import jsonschema

import described
from described import DOCUMENT as document, resolve
from served import SCRATCH, TETLOD, Server, run

FOLDER = os.path.join(SCRATCH, 'streams')
server = None


def references(node):
    if isinstance(node, dict):
        if '$ref' in node:
            yield node
        for value in node.values():
            yield from references(value)
    elif isinstance(node, list):
        for value in node:
            yield from references(value)


def test_document():
    assert re.fullmatch(r'3\.1\.\d+', document['openapi']) and document['info']['title'] and document['info']['version']
    ids = []
    for reference in references(document):
        resolve(reference)
    for path, item in document['paths'].items():
        assert path.startswith('/') and set(item) == {'get'}, path
        operation = item['get']
        ids.append(operation['operationId'])
        parameters = [resolve(p) for p in operation.get('parameters', [])]
        assert len({(p['name'], p['in']) for p in parameters}) == len(parameters), path
        for parameter in parameters:
            assert parameter['in'] in ('path', 'query', 'header') and parameter['schema'], parameter
            assert parameter['in'] != 'path' or parameter['required']
        assert set(re.findall(r'\{(\w+)\}', path)) == {p['name'] for p in parameters if p['in'] == 'path'}, path
        for status, answer in operation['responses'].items():
            assert re.fullmatch(r'[1-5]\d\d|default', status) and resolve(answer)['description']
    assert len(ids) == len(set(ids))
    for schema in document['components']['schemas'].values():
        jsonschema.Draft202012Validator.check_schema(schema)


def concrete(path, cid, **changes):
    """A path with its parameters' examples, and the query of those that are required."""
    operation = document['paths'][path]['get']
    query = {}
    for parameter in map(resolve, operation.get('parameters', [])):
        example = changes.get(parameter['name'], cid if parameter['name'] == 'cid' else parameter.get('example'))
        if isinstance(example, list):
            example = ','.join(map(str, example))
        if parameter['in'] == 'path':
            path = path.replace('{%s}' % parameter['name'], urllib.parse.quote(str(example)))
        elif parameter['in'] == 'query' and (parameter.get('required') or parameter['name'] in changes):
            query[parameter['name']] = example
    return path + ('?' + urllib.parse.urlencode(query) if query else '')


def check(path, asked, **headers):
    """The status of an answer, which server.get holds against the description."""
    assert described.path_of(asked) == path, (asked, path)
    return server.get(asked, **headers)[0]


def stream_for(path):
    """The stream that has what a path is about, as changes of its examples, and its content id."""
    id = 'run' if '{band}' in path else 'fin'
    return {'id': id,
            **({'error': '0.1'} if path.endswith(('/mesh', '/prefix')) else {})}, server.json('/v1/meshes/' + id)['cid']


def test_every_operation():
    for path in document['paths']:
        changes, cid = stream_for(path)
        status = check(path, concrete(path, cid, **changes))
        assert status == (303 if path.endswith('/mesh') else 200), (path, status)
        if '304' in document['paths'][path]['get']['responses']:
            asked = concrete(path, cid, **changes)
            assert check(path, asked, If_None_Match=server.get(asked)[1]['etag']) == 304
        if '416' in document['paths'][path]['get']['responses']:
            assert check(path, concrete(path, cid, **changes), Range='bytes=0-3') == 206
            assert check(path, concrete(path, cid, **changes), Range='bytes=999999999-') == 416
        if '404' in document['paths'][path]['get']['responses'] and path.startswith('/v1/'):
            assert check(path, concrete(path, cid, id='nothing')) == 404
        if path.startswith('/v1/'):
            asked = concrete(path, cid, **changes)
            assert check(path, asked + ('&' if '?' in asked else '?') + 'unknown=1') == 400
        if '{cid}' in path:
            assert check(path, concrete(path, '0' * 32, **changes)) == 404
        if '{format}' in path:
            assert check(path, concrete(path, cid, **{**changes, 'format': 'doc'})) == 400
        for number in ('level', 'band', 'step', 'group'):
            if '{%s}' % number in path:
                assert check(path, concrete(path, cid, **{**changes, number: 99999})) == 400
        if '{band}' in path:
            assert check(path, concrete(path, server.json('/v1/meshes/fin')['cid'], id='fin')) == 404


def test_steps():
    for path, status in (('/v1/meshes/{id}/mesh', 303), ('/v1/meshes/{id}/prefix', 200)):
        for choice in ('time', 'step'):
            changes = {'id': 'run', 'error': '0.1', choice: '1'}
            asked = concrete(path, '', **changes)
            got, head, _ = server.get(asked)
            assert got == status and head['tetlod-step'] == '1', (asked, got, head)
            assert check(path, concrete(path, '', **{**changes, choice: 'x'})) == 400
            assert check(path, concrete(path, '', **{**changes, 'id': 'fin'})) == 404
            assert server.get(concrete(path, '', **changes) + '&abs_error=1')[0] == 400


def test_formats():
    for path in document['paths']:
        changes, cid = stream_for(path)
        for parameter in map(resolve, document['paths'][path]['get'].get('parameters', [])):
            if parameter['name'] == 'format':
                for name in parameter['schema']['enum']:
                    assert check(path, concrete(path, cid, **{**changes, 'format': name})) in (200, 303), (path, name)


def test_pages():
    """What is not there is a page for clients that accept HTML, and a problem for others."""
    for path in document['paths']:
        if path.startswith('/v1/meshes/'):
            assert check(path, concrete(path, '0' * 32, id='nothing'), Accept='text/html') == 404
    assert check('/view/{id}', '/view/%00', Accept='text/html') == 404
    assert check('/v1/meshes/{id}', '/v1/meshes/fin?unknown=1') == 400
    with Server(FOLDER, '--metrics', '127.0.0.1:0') as apart:
        assert apart.get('/metrics', Accept='text/html')[0] == 404


def test_too_much():
    """A lossy stream has no level within an error of 0, a point outside of the mesh no value; what takes more than the
    server's memory is refused."""
    build('fin.vtu', os.path.join(SCRATCH, 'lossy.tetlod'), '--field-bits', '8')
    subprocess.run([TETLOD, 'sample', 'wake', '--size', '12', '--steps', '2', '-o', 'large.pvd'], cwd=SCRATCH,
                   check=True)
    build('large.pvd', os.path.join(SCRATCH, 'large.tetlod'), '--bands', '10%')
    paths = [os.path.join(SCRATCH, name + '.tetlod') for name in ('lossy', 'large')]
    with Server(*paths, '--cache', '1M', '--memory', '1M') as small:
        described_large = small.json('/v1/meshes/large')
        finest = len(described_large['levels']) - 1
        for path, item in document['paths'].items():
            if '422' not in item['get']['responses']:
                continue
            changes = {'id': 'large', 'level': finest, 'band': 1, 'box': '0,0,0,9,9,9', 'box_level': finest,
                       'value': 0.5}
            if 'region' in path:
                changes['level'] = 0
            if '{cid}' not in path:
                changes = {'id': 'lossy', 'error': '0', 'q': 'Pressure at (99,0,0)'}
            asked = concrete(path, described_large['cid'], **changes)
            assert small.get(asked)[0] == 422, asked


def test_all_was_seen():
    """Every status that the description names came from every operation, with every header that it names. Any operation
    may answer 503; test_protocol.py and test_meshes.py see it."""
    for path, item in document['paths'].items():
        for status, answer in item['get']['responses'].items():
            if status in ('503', 'default'):
                continue
            assert (path, status) in described.SEEN, (path, status)
            missing = {name.lower() for name in resolve(answer).get('headers', {})} - described.SEEN[path, status]
            assert not missing, (path, status, missing)


def build(mesh, stream, *options):
    subprocess.run([TETLOD, 'build', mesh, '-o', stream, '--quiet', *options], cwd=SCRATCH, check=True)


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
build('fin.vtu', os.path.join(FOLDER, 'fin.tetlod'), '--field', 'Pressure')
subprocess.run([TETLOD, 'sample', 'wake', '--size', '4', '--steps', '2', '-o', 'run.pvd'], cwd=SCRATCH, check=True)
build('run.pvd', os.path.join(FOLDER, 'run.tetlod'), '--field', 'Pressure', '--bands', '10%,1%')
with Server(FOLDER) as server:
    assert server.json('/openapi.json') == document
    run([test_document, test_every_operation, test_steps, test_formats, test_pages, test_too_much, test_all_was_seen])
