// SPDX-License-Identifier: Apache-2.0
// A flight that is pressed, on a figure or beside a command, has its command copied
const note = document.querySelector(".copied");
let fading = 0;
async function copy(command) {
  let done = true;
  try {
    await navigator.clipboard.writeText(command);
  } catch {
    const box = document.createElement("textarea");
    box.value = command;
    document.body.append(box);
    box.select();
    done = document.execCommand("copy");
    box.remove();
  }
  note.textContent = `${done ? "Copied" : "To copy"}: ${command}`;
  note.hidden = false;
  clearTimeout(fading);
  fading = setTimeout(() => { note.hidden = true; }, done ? 6000 : 60000);
}
const flightOf = (text) => (/^flight (\d+)/.exec(text || "") || [])[1];
document.addEventListener("drawn", () => {
  for (const plot of plots) {
    plot.removeAllListeners("plotly_click");
    plot.on("plotly_click", ({ points }) => {
      const flight = points.map((one) => flightOf(one.text)).find(Boolean);
      if (flight) copy(`${report.command} --flight ${flight}`);
    });
  }
});
document.querySelectorAll(".case button").forEach((button) => {
  button.addEventListener("click", () => copy(button.previousElementSibling.textContent));
});
