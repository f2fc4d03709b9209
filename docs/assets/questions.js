// Whole questions may be typed into the search. Words that every page has are left out of them.
// Words that no page has stand for those of the pages.
{
  const meant = [
    [/\b(while\b.*)?\bstill (going on|driving|running|under way)\b/gi, "live"],
    [/\b(real[ -]?time|streams?|streaming)\b/gi, "live"],
    [/\b(bulk|batch(es)?)\b/gi, "fleet"],
    [/\b(validation|validate[ds]?|precision|precise)\b/gi, "accuracy"],
    [/\bbenchmarks?\b/gi, "$& accuracy"],
    [/\b(coverage|confidence)\b/gi, "interval"],
    [/\b(no|without|missing) torque\b/gi, "$& only speed"],
    [/\brecalibrat(e[ds]?|ing|ions?)\b/gi, "calibrate again"],
    [/\bsigmas?\b/gi, "standard deviation"],
    [/\bplug[ -]?ins?\b/gi, "plug-in own method"],
    [/\bgps\b/gi, "$& gnss"],
    [/\btow(s|ed|ing)?\b/gi, "$& trailer"],
    [/\b(gradients?|slopes?|inclines?)\b/gi, "$& grade"],
    [/\btire(s?)\b/gi, "tyre$1"],
    [/\b(iphones?|smartphones?|android)\b/gi, "$& phone"],
    [/\bkeyboard\b/gi, "$& keys"],
    [/\bpdf\b/gi, "$& print"],
    [/\b(gdpr|dsgvo)\b/gi, "$& privacy"],
    [/\bdecimal commas?\b/gi, "decimal csv semicolon"],
    [/\b(contact|support|bugs?)\b/gi, "report fault stuck"],
    [/\b(weight|heavy)\b/gi, "$& mass"],
    [/\breal data\b/gi, "recorded drives"],
  ];
  const common = new Set(
    ("a an and are at be by call called can do does for from has have how i in is it may mean means " +
      "much must my of on or our should that the their this to use we what when where which who why will " +
      "with you your").split(" "),
  );
  const QUERY = 2;
  const send = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...more) {
    if (message?.type === QUERY && typeof message.data === "string") {
      const asked = meant.reduce((text, [said, word]) => text.replace(said, word), message.data);
      const words = asked.replace(/[?!.,]+(?=\s|$)/g, "").split(/\s+/).filter(Boolean);
      const rare = words.filter((word) => !common.has(word.toLowerCase()));
      message = { ...message, data: (rare.length ? rare : words).join(" ") };
    }
    return send.call(this, message, ...more);
  };
}
