/* Tables that are wider than a screen scroll: let the keyboard scroll them too, once the theme has wrapped them. */
addEventListener("load", () => {
  for (const table of document.querySelectorAll(".md-typeset__scrollwrap")) table.tabIndex = 0;
});
