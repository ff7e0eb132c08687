"""A language server of editors, spoken to as an editor does."""

import json
import shutil
import subprocess

PROGRAM = "yaml-language-server"


def missing():
    """Return why there is no language server; empty if there is one."""
    if shutil.which(PROGRAM) is None:
        return f"needs {PROGRAM}: npm install -g {PROGRAM}"
    return ""


class LanguageServer:
    """The server of YAML documents, which knows no schema but those that documents name."""

    def __init__(self):
        self._process = subprocess.Popen(
            [PROGRAM, "--stdio"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._asked, self._found = 0, {}
        self._ask("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        self._send(method="initialized", params={})
        settings = {"validate": True, "completion": True, "schemaStore": {"enable": False}}
        self._send(
            method="workspace/didChangeConfiguration", params={"settings": {"yaml": settings}}
        )

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._process.kill()
        self._process.wait()
        self._process.stdin.close()
        self._process.stdout.close()

    def marks(self, file):
        """Return what the server says of a file: lines, from 0, and sentences."""
        document = {"uri": file.as_uri(), "languageId": "yaml", "version": 1}
        document["text"] = file.read_text()
        self._send(method="textDocument/didOpen", params={"textDocument": document})
        while document["uri"] not in self._found:
            self._read()
        found = self._found.pop(document["uri"])
        return [(each["range"]["start"]["line"], each["message"]) for each in found]

    def completions(self, file, line, column):
        """Return what may stand at a place of a file that was opened, with explanations."""
        asked = self._at("textDocument/completion", file, line, column)
        return {each["label"]: each.get("documentation", "") for each in asked["items"]}

    def hover(self, file, line, column):
        """Return what is shown at a place of a file that was opened."""
        return self._at("textDocument/hover", file, line, column)["contents"]["value"]

    def _at(self, method, file, line, column):
        place = {"line": line, "character": column}
        return self._ask(method, {"textDocument": {"uri": file.as_uri()}, "position": place})

    def _ask(self, method, params):
        self._asked += 1
        self._send(id=self._asked, method=method, params=params)
        while True:
            message = self._read()
            if message.get("id") == self._asked and "method" not in message:
                return message["result"]

    def _send(self, **message):
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self._process.stdin.flush()

    def _read(self):
        size = 0
        while line := self._process.stdout.readline().strip():
            name, _, value = line.partition(b":")
            size = int(value) if name.lower() == b"content-length" else size
        assert size, "the language server has ended"
        message = json.loads(self._process.stdout.read(size))
        if message.get("method") == "textDocument/publishDiagnostics":
            self._found[message["params"]["uri"]] = message["params"]["diagnostics"]
        elif "id" in message and "method" in message:
            self._send(id=message["id"], result=None)
        return message
