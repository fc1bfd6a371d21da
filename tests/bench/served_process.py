# SPDX-License-Identifier: BSD-3-Clause
"""A server of its own for a measurement, with what it takes of the machine."""
import http.client
import os
import re
import subprocess
import sys
import urllib.parse


class Server:
    """Serves a stream or a folder until the end of a `with`."""

    def __init__(self, tetlod, path, *options):
        self.process = subprocess.Popen([tetlod, 'serve', path, '--listen', '127.0.0.1:0', '--quiet', *options],
                                        stdout=subprocess.PIPE)
        self.port = int(re.search(rb':(\d+)/', self.process.stdout.readline())[1])

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.process.terminate()
        self.process.wait()

    def get(self, path):
        connection = http.client.HTTPConnection('127.0.0.1', self.port, timeout=600)
        connection.request('GET', path)
        answer = connection.getresponse()
        body = answer.read()
        if answer.status not in (200, 303):
            sys.exit('%s: %d %s' % (path, answer.status, body[:300]))
        return answer, body

    def level(self, name, query):
        """The address of a level, whose meshes are below it, and its tetrahedra."""
        about = '/v1/meshes/' + name
        answer, _ = self.get('%s/mesh?%s' % (about, query))
        return urllib.parse.urljoin(about + '/mesh',
                                    answer.getheader('Location')).rsplit('/',
                                                                         1)[0], int(answer.getheader('Tetlod-Tets'))

    def metric(self, name):
        return float(re.search(r'^%s (\S+)' % name, self.get('/metrics')[1].decode(), re.M)[1])

    def processor_seconds(self):
        with open('/proc/%d/stat' % self.process.pid) as stat:
            return sum(map(int, stat.read().rsplit(')', 1)[1].split()[11:13])) / os.sysconf('SC_CLK_TCK')

    def kilobytes(self, key):
        with open('/proc/%d/status' % self.process.pid) as status:
            return int(re.search(key + r':\s+(\d+)', status.read())[1])
