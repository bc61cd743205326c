// SPDX-License-Identifier: Apache-2.0
// A flight that is pointed at on the globe says which one it is.
const said = document.querySelector(".pointed");
const asked = said.textContent;
function point(event) {
  const box = globe.canvas.getBoundingClientRect();
  const flight = globe.nearest(event.clientX - box.left, event.clientY - box.top);
  if (flight === (globe.pointed || null)) return;
  globe.pointed = flight;
  said.textContent = flight ? flight.name : asked;
  globe.draw();
}
globe.canvas.addEventListener("pointermove", point);
globe.canvas.addEventListener("pointerdown", point);
