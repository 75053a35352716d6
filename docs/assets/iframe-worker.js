/* Search in a page that is opened from a folder: browsers refuse workers there, so a hidden frame does the work.
 *
 * The frame loads the worker's script; messages go from one to the other as they would to a worker. A worker's
 * `importScripts` loads one script after another. Pages that a server sends have workers and need none of this.
 */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.title = "search";
      document.body.append(frame);
      const inner = frame.contentWindow;
      inner.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      inner.importScripts = (...scripts) =>
        scripts.reduce((before, script) => before.then(() => load(inner, script)), Promise.resolve());
      this.ready = load(inner, address).then(() => inner);
    }

    postMessage(data) {
      this.ready.then((inner) => inner.dispatchEvent(new inner.MessageEvent("message", { data })));
    }
  };

  function load(inner, address) {
    return new Promise((done, failed) => {
      const script = inner.document.createElement("script");
      script.src = new URL(address, location.href).href;
      script.onload = done;
      script.onerror = failed;
      inner.document.body.append(script);
    });
  }
}
