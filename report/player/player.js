// The player: plays a film with the controls of the page. All that is shown follows from one number, the time in the film, so that
// playing, stepping and scrubbing show the same.

/** After a pause of the browser the film goes on where it stopped. */
const FRAME_MAX_S = 0.25;
const control = (id) => document.getElementById(id);

export class Player {
  /** `show` is called with the time of each frame, or with null when the film is left; `keys` is where keys control the player. */
  constructor(show, keys) {
    Object.assign(this, { show, film: null, time: null, playing: false, showsTurns: false, box: control("player") });
    this.calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    [this.scrub, this.speed, this.turns] = ["scrub", "speed", "turns"].map(control);
    const acts = {
      play: () => this.toggle(), start: () => this.seek(this.first), finish: () => this.seek(this.length),
      back: () => this.step(-1), forward: () => this.step(1), turns: () => this.showTurns(this.first > 0),
    };
    for (const [id, act] of Object.entries(acts)) control(id).addEventListener("click", act);
    this.scrub.addEventListener("input", () => {
      this.pause();
      this.seek(this.scrub.valueAsNumber);
    });
    keys.addEventListener("keydown", (event) => this.press(event));
  }

  /** Takes in another film, or none; it is shown once it is played, for as long as the longest of those that are shown beside it. */
  load(film, length = film?.length) {
    this.pause();
    Object.assign(this, { film, length });
    for (const one of this.box.querySelectorAll("button, #scrub")) one.disabled = !film;
    this.scrub.max = length ?? 1;
    this.turns.hidden = !film?.begin;
    this.limit(this.showsTurns ? 0 : film?.begin ?? 0);
    control("clock").textContent = film ? `${film.seconds(length).toFixed(2)} s` : "";
    this.leave();
  }

  /** Ends the film where it is. */
  leave() {
    this.pause();
    this.time = null;
    this.scrub.value = this.first;
    this.show(null);
  }

  /** The film begins at the first motion; the turns before it, in which spots are chosen, are shown on demand. */
  limit(first) {
    this.scrub.min = this.first = first;
    this.turns.setAttribute("aria-pressed", String(first < (this.film?.begin ?? 0)));
  }

  showTurns(shown) {
    this.showsTurns = shown;
    this.limit(shown ? 0 : this.film.begin);
    this.seek(this.first);
  }

  /** Shows a time, and the turns if it is one of theirs. */
  open(time) {
    if (time < this.first) this.limit(0);
    this.seek(time);
  }

  toggle() {
    if (this.playing) this.pause();
    else if (this.film) this.play();
  }

  play() {
    if (this.time == null || this.time >= this.length) this.seek(this.first);
    this.mark(true);
    this.previous = null;
    this.frame = requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    if (!this.playing) return;
    cancelAnimationFrame(this.frame);
    this.mark(false);
    // It stands, so all that is shown can be read.
    this.seek(this.time);
  }

  mark(playing) {
    this.playing = playing;
    this.box.classList.toggle("playing", playing);
    control("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  }

  tick(now) {
    const passed = Math.min((now - (this.previous ?? now)) / 1000, FRAME_MAX_S);
    this.previous = now;
    this.seek(this.time + passed * Number(this.speed.value));
    if (this.time >= this.length) this.pause();
    else this.frame = requestAnimationFrame((next) => this.tick(next));
  }

  /** Whoever wants no motion sees each step when it begins. */
  seek(time) {
    this.time = Math.min(Math.max(time, this.first), this.length);
    this.scrub.value = this.time;
    const isStill = this.calm && this.playing && this.time < this.length;
    const shown = isStill ? Math.max(this.film.beginOfStep(this.time), this.first) : this.time;
    this.box.dataset.time = this.time;
    control("clock").textContent = `${this.film.seconds(shown).toFixed(2)} s`;
    this.show(shown);
  }

  step(direction) {
    this.pause();
    this.seek(this.film.neighbour(this.time ?? this.first, direction, [this.first, this.length]));
  }

  press(event) {
    if (!this.film || event.ctrlKey || event.metaKey || event.altKey) return;
    const { target } = event;
    // A control that has the focus handles its own keys.
    const pressesButton = target.closest("button, summary, a, label, [type=checkbox]");
    const scrolls = target.closest("select, .scroll, #steps");
    if (event.key === " " && !pressesButton && !target.closest("select")) this.toggle();
    else if (scrolls) return;
    else if (event.key === "ArrowRight") this.step(1);
    else if (event.key === "ArrowLeft") this.step(-1);
    else if (event.key === "Home") this.seek(this.first);
    else if (event.key === "End") this.seek(this.length);
    else return;
    event.preventDefault();
  }
}
