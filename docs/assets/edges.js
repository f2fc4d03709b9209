// What is wider than the page scrolls. Its right edge fades as long as more of it is to come.
{
  const wide = ".md-typeset .equation, .md-typeset__scrollwrap, .md-typeset pre > code";
  const tell = (box) => box.classList.toggle("more", box.scrollWidth - box.clientWidth - box.scrollLeft > 2);
  addEventListener("load", () => {
    const sizes = new ResizeObserver((seen) => seen.forEach(({ target }) => tell(target)));
    for (const box of document.querySelectorAll(wide)) {
      sizes.observe(box);
      box.addEventListener("scroll", () => tell(box), { passive: true });
    }
  });
}
