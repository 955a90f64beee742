// The divider between two pictures of a scene: dragged, or moved by the arrow keys; and the choice of the two.
"use strict";
for (const compare of document.querySelectorAll(".compare")) {
  const divider = compare.querySelector(".divider");
  const images = [compare.querySelector(".left"), compare.querySelector(".right")];
  const choices = compare.closest("section").querySelectorAll(".choose select");

  const place = (percent) => {
    const value = Math.min(100, Math.max(0, percent));
    compare.style.setProperty("--cut", value + "%");
    divider.setAttribute("aria-valuenow", Math.round(value));
  };
  const follow = (event) => {
    const box = compare.getBoundingClientRect();
    place((100 * (event.clientX - box.left)) / box.width);
  };
  compare.addEventListener("pointerdown", (event) => {
    compare.setPointerCapture(event.pointerId);
    follow(event);
    divider.focus({ preventScroll: true });
    event.preventDefault();
  });
  compare.addEventListener("pointermove", (event) => {
    if (compare.hasPointerCapture(event.pointerId)) follow(event);
  });
  divider.addEventListener("keydown", (event) => {
    const now = Number(divider.getAttribute("aria-valuenow"));
    const steps = { ArrowLeft: -2, ArrowDown: -2, ArrowRight: 2, ArrowUp: 2, PageDown: -10, PageUp: 10 };
    const target = event.key === "Home" ? 0 : event.key === "End" ? 100 : now + (steps[event.key] ?? NaN);
    if (Number.isNaN(target)) return;
    place(target);
    event.preventDefault();
  });
  choices.forEach((choice, side) => {
    const show = () => {
      const chosen = choice.selectedOptions[0];
      images[side].src = document.getElementById(chosen.value).src;
      images[side].alt = chosen.textContent;
    };
    choice.addEventListener("change", show);
    show();
  });
}
