// What comes and goes: samples over Meshcat's websocket, settings over HTTP.

// Time between two messages [ms], between two signs of life, and before a lost connection is tried
// again.
const BETWEEN = 33, ALIVE = 1500, AGAIN = 1000;
// Numbers that a sample begins with: version, time, rate, recorded; and that it ends with.
const HEAD = 4, TAIL = 6;
const MOVES = ["arm", "desired", "traced", "obstacles", "force", "target", "ahead"];

const wire = {
  // Empty while another page has the controls; null until that is known.
  key: null,
  waiting: new Map(),
  sending: false,
  asking: false,
  sample: null,
  onSample() {},
  onKey() {},

  connect() {
    const socket = new WebSocket(`ws://${location.hostname}:${data.port}`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data: bytes }) => this.hear(new Uint8Array(bytes));
    socket.onclose = () => {
      this.onSample(null);
      setTimeout(() => this.connect(), AGAIN);
    };
  },

  hear(bytes) {
    let command;
    try {
      command = viewer === null ? MeshCat.msgpack.decode(bytes) : viewer.decode({ data: bytes });
    } catch { return; }
    const path = (command.path || "").split("/").filter(Boolean);
    if (command.type === "set_property" && path[0] === "live") {
      if (command.property === "said") tellHeld(String.fromCodePoint(...command.value).trim());
      else this.onSample(command.value);
    }
    else if (["set_transform", "set_property"].includes(command.type) && viewer !== null
      && MOVES.includes(path[0])) {
      viewer.handle_command(command);
      viewer.set_dirty();
    }
  },

  async post(path, body) {
    const headers = { "Content-Type": "application/json", "X-Key": this.key ?? "" };
    return fetch(path, { method: "POST", headers, body: JSON.stringify(body) });
  },

  /** Asks for the controls, or tells that this page still has them. */
  async ask() {
    // A second question before the first is answered would have no key to show.
    if (this.asking) return;
    this.asking = true;
    try {
      const { key } = await (await this.post("/controls", null)).json();
      if (key !== this.key) { this.key = key; this.onKey(key !== ""); }
    } catch { /* The program has ended, or begins. */ }
    this.asking = false;
  },

  /** Sets a control; of what is set between two messages, the last counts. */
  set(name, value) {
    if (!this.key) return;
    this.waiting.delete(name);
    this.waiting.set(name, value);
    if (!this.sending) this.send();
  },

  async send() {
    this.sending = true;
    while (this.waiting.size) {
      const settings = [...this.waiting];
      this.waiting.clear();
      try { await this.post("/set", settings); } catch { break; }
      await new Promise((resolve) => setTimeout(resolve, BETWEEN));
    }
    this.sending = false;
  },

  async state() {
    return (await fetch("/state", { cache: "no-store" })).json();
  },

  begin() {
    this.connect();
    this.ask();
    setInterval(() => this.ask(), ALIVE);
    window.addEventListener("pagehide", () => {
      if (!this.key) return;
      const headers = { "X-Key": this.key };
      fetch("/return", { method: "POST", headers, keepalive: true });
    });
  },
};
