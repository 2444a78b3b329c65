// SeerobClient.cs without Unity: comes in, stands somewhere, and prints what it sees.
//
//   mcs SeerobClient.cs Visitor.cs -out:visitor.exe && mono visitor.exe ws://127.0.0.1:8080/ws 10
using System;
using System.Globalization;
using System.Threading.Tasks;
using Seerob;

static class Program
{
    static async Task Visit(string url, double seconds)
    {
        using (var client = new Client())
        {
            await client.Connect(url, "unity");
            var listening = client.Listen();
            var until = DateTime.UtcNow.AddSeconds(seconds);
            while (DateTime.UtcNow < until && !listening.IsCompleted)
            {
                await client.Presence(new Pose { X = 2, Y = 1.7f, Z = 1, Qw = 1 }, null, null);
                await Task.Delay(33);
            }
            foreach (var body in client.Bodies)
                Console.WriteLine(string.Format(CultureInfo.InvariantCulture, "body {0} {1:R} {2:R} {3:R}",
                    body.Key, body.Value.X, body.Value.Y, body.Value.Z));
            foreach (var verdict in client.Verdicts) Console.WriteLine("verdict " + verdict.Key + " " + verdict.Value);
            foreach (var other in client.Others.Values) Console.WriteLine("visitor " + other.Id + " " + other.Name);
        }
    }

    static void Main(string[] arguments)
    {
        Visit(arguments[0], double.Parse(arguments[1], CultureInfo.InvariantCulture)).GetAwaiter().GetResult();
    }
}
