// A loop between two times: its ends are set one by one, or are those of what the chart shows.

// Length of a loop of which one end alone is known, as a share of the run.
const LOOPED = 0.1;

/** Begins the loop at the time that is shown; behind its end, it becomes a new one. */
function loopFromHere() {
  const from = Math.min(player.time, data.duration * (1 - 1e-3));
  const end = player.loop?.[1] ?? data.duration;
  player.setLoop([from, end > from ? end : Math.min(data.duration, from + LOOPED * data.duration)]);
}

/** Ends the loop at the time that is shown. */
function loopToHere() {
  const to = Math.max(player.time, data.duration * 1e-3);
  const begin = player.loop?.[0] ?? 0;
  player.setLoop([begin < to ? begin : Math.max(0, to - LOOPED * data.duration), to]);
}

/** The loop that was ended last. */
let looped = null;

/** Ends looping, or loops what was looped before; in a chart of a part of the run, what that shows. */
function toggleLoop() {
  const wasOn = player.loop !== null;
  if (wasOn) looped = player.loop;
  const shown = [span.from, Math.min(span.to, data.duration)];
  player.setLoop(wasOn ? null : zoom.whole ? looped ?? shown : shown);
}

function listenToLoop() {
  byId("loop-from").addEventListener("click", loopFromHere);
  byId("loop-to").addEventListener("click", loopToHere);
  byId("loop").addEventListener("click", toggleLoop);
}
