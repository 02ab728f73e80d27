/* Films play while they are in view, unless the reader asked the system for less motion. */
addEventListener("DOMContentLoaded", () => {
  if (matchMedia("(prefers-reduced-motion: reduce)").matches || !("IntersectionObserver" in window)) return;
  const watched = new IntersectionObserver(films => {
    for (const film of films) film.isIntersecting ? film.target.play().catch(() => {}) : film.target.pause();
  });
  document.querySelectorAll(".film video").forEach(film => watched.observe(film));
});
