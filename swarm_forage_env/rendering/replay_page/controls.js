// Buttons, the slider and keys.

function connectControls(player, page) {
  const byId = (id) => document.getElementById(id);
  const scrub = byId("scrub");
  const speed = byId("speed");
  scrub.max = String(player.endS);
  for (const factor of SPEEDS) speed.add(new Option(`${factor}×`, String(factor)));
  byId("play").onclick = () => player.toggle();
  scrub.oninput = () => player.seek(Number(scrub.value));
  speed.onchange = () => {
    player.speed = Number(speed.value);
    player.dirty = true;
  };
  byId("whole").onclick = () => page.showWhole();
  byId("theme").onclick = () => theme.toggle();
  byId("help").onclick = () => byId("keys").showModal();
  document.addEventListener("keydown", (event) => pressKey(event, player, page));
}

/** Let the controls show what time it is. */
function showTime(player) {
  const clock = document.getElementById("clock");
  const play = document.getElementById("play");
  document.getElementById("scrub").value = String(player.time);
  document.getElementById("speed").value = String(player.speed);
  clock.innerHTML = `${Math.round(player.time).toLocaleString("en")} s <small>of ${player.endS.toLocaleString("en")} s</small>`;
  play.textContent = player.playing ? "❚❚" : "▶";
  play.setAttribute("aria-label", player.playing ? "Pause" : "Play");
}

const KEYS = {
  " ": ({ player }) => player.toggle(),
  ArrowLeft: ({ player, page, shift }) => player.seek(player.time - (shift ? page.frameS : 10)),
  ArrowRight: ({ player, page, shift }) => player.seek(player.time + (shift ? page.frameS : 10)),
  ArrowUp: ({ player }) => player.shift(1),
  ArrowDown: ({ player }) => player.shift(-1),
  Home: ({ player }) => player.seek(0),
  End: ({ player }) => player.seek(player.endS),
  "+": ({ page }) => page.zoom(1.4),
  "=": ({ page }) => page.zoom(1.4),
  "-": ({ page }) => page.zoom(1 / 1.4),
  0: ({ page }) => page.showWhole(),
  f: ({ page }) => page.follow(!focus.follows),
  t: () => theme.toggle(),
  "?": () => document.getElementById("keys").showModal(),
  Escape: ({ page }) => page.choose(-1, null),
};

function pressKey(event, player, page) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (isTyping(event) || !Object.hasOwn(KEYS, key)) return;
  event.preventDefault();
  KEYS[key]({ player, page, shift: event.shiftKey });
}
