/* Mark the partners of the line that is pointed at, or that has the focus, in a listing of kernels. */
(() => {
  let marked = [];
  const mark = (event) => {
    const row = event.target.closest && event.target.closest("[data-line]");
    for (const other of marked) other.classList.remove("marked");
    const same = row ? `[data-line="${row.dataset.line}"]` : null;
    marked = same ? [...row.closest(".listing").querySelectorAll(same)] : [];
    for (const other of marked) other.classList.add("marked");
  };
  document.addEventListener("mouseover", mark);
  document.addEventListener("focusin", mark);
})();
