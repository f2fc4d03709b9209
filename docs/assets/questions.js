// Whole questions may be typed into the search. Words that every page has are left out of them.
{
  const common = new Set(
    ("a an and are at be by call called can do does for from has have how i in is it may mean means " +
      "much must my of on or our should that the their this to use we what when where which who why will " +
      "with you your").split(" "),
  );
  const QUERY = 2;
  const send = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...more) {
    if (message?.type === QUERY && typeof message.data === "string") {
      const words = message.data.replace(/[?!.,]+(?=\s|$)/g, "").split(/\s+/).filter(Boolean);
      const rare = words.filter((word) => !common.has(word.toLowerCase()));
      message = { ...message, data: (rare.length ? rare : words).join(" ") };
    }
    return send.call(this, message, ...more);
  };
}
