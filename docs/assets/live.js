/* Put the live page into a frame, in the place of its picture, when the reader asks: it keeps a device busy. */
(() => {
  for (const place of document.querySelectorAll("[data-live]")) {
    const button = place.querySelector("button");
    button.hidden = false;
    button.addEventListener("click", () => {
      const frame = document.createElement("iframe");
      frame.title = "The mini cubes, path-traced and denoised live";
      frame.src = place.dataset.live;
      const figure = place.previousElementSibling;
      if (figure && figure.matches("figure")) figure.querySelector("img").replaceWith(frame);
      else place.before(frame);
      button.remove();
      frame.focus();
    });
  }
})();
