// Prints the models of SDF files as libsdformat reads them, one JSON object a line: links with
// their poses, masses and moments, collisions, and joints with their axes and limits. Poses and
// axes are in the frame of the outermost model, or of the world.
//
// Usage: sdf_models FOLDER FILE…; FOLDER contains the models of `model://`.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>

#include <sdf/sdf.hh>

namespace
{
const char *const OWN = "__model__";

std::string Quoted(const std::string &text)
{
  std::ostringstream out;
  out << '"';
  for (const char letter : text)
  {
    if (letter == '"' || letter == '\\')
      out << '\\';
    out << (letter == '\n' ? ' ' : letter);
  }
  out << '"';
  return out.str();
}

std::string Number(double value)
{
  if (!std::isfinite(value))
    return "null";
  std::ostringstream out;
  out.precision(17);
  out << value;
  return out.str();
}

template <class V> std::string Three(const V &value)
{
  return "[" + Number(value.X()) + "," + Number(value.Y()) + "," + Number(value.Z()) + "]";
}

// A position and the quaternion of a rotation: x, y, z, w.
template <class P> std::string Placed(const P &pose)
{
  const auto &turn = pose.Rot();
  return "{\"at\":" + Three(pose.Pos()) + ",\"turned\":[" + Number(turn.X()) + "," +
         Number(turn.Y()) + "," + Number(turn.Z()) + "," + Number(turn.W()) + "]}";
}

struct Printed
{
  std::ostringstream links, joints, faults;

  void Check(const sdf::Errors &errors)
  {
    for (const auto &error : errors)
      this->faults << error.Message() << "; ";
  }
};

std::string Sized(const sdf::Geometry &geometry)
{
  if (const auto *box = geometry.BoxShape())
    return "\"type\":\"box\",\"size\":" + Three(box->Size());
  if (const auto *sphere = geometry.SphereShape())
    return "\"type\":\"sphere\",\"size\":[" + Number(sphere->Radius()) + "]";
  if (const auto *cylinder = geometry.CylinderShape())
    return "\"type\":\"cylinder\",\"size\":[" + Number(cylinder->Radius()) + "," +
           Number(cylinder->Length()) + "]";
  if (const auto *capsule = geometry.CapsuleShape())
    return "\"type\":\"capsule\",\"size\":[" + Number(capsule->Radius()) + "," +
           Number(capsule->Length()) + "]";
  if (const auto *ellipsoid = geometry.EllipsoidShape())
    return "\"type\":\"ellipsoid\",\"size\":" + Three(ellipsoid->Radii());
  if (const auto *mesh = geometry.MeshShape())
    return "\"type\":\"mesh\",\"size\":" + Three(mesh->Scale());
  return "\"type\":\"other\",\"size\":[]";
}

// The coefficient for ODE, with its default.
double Friction(sdf::ElementPtr element)
{
  for (const char *name : {"surface", "friction", "ode"})
  {
    if (!element || !element->HasElement(name))
      return 1.0;
    element = element->GetElement(name);
  }
  return element->Get<double>("mu", 1.0).first;
}

template <class P>
void PrintLink(const sdf::Link &link, const P &model, const std::string &prefix, Printed &out)
{
  P at;
  out.Check(link.SemanticPose().Resolve(at, OWN));
  at = model * at;
  const auto &inertial = link.Inertial();
  const auto &moments = inertial.MassMatrix();
  out.links << (out.links.tellp() > 0 ? "," : "") << Quoted(prefix + link.Name())
            << ":{\"pose\":" << Placed(at) << ",\"kg\":" << Number(moments.Mass())
            << ",\"inertia\":{\"pose\":" << Placed(at * inertial.Pose()) << ",\"diagonal\":"
            << Three(moments.DiagonalMoments()) << ",\"products\":"
            << Three(moments.OffDiagonalMoments()) << "},\"collisions\":[";
  for (uint64_t idx = 0; idx < link.CollisionCount(); ++idx)
  {
    const auto *collision = link.CollisionByIndex(idx);
    P own;
    out.Check(collision->SemanticPose().Resolve(own, link.Name()));
    const double friction = Friction(collision->Element());
    out.links << (idx > 0 ? "," : "") << "{\"pose\":" << Placed(at * own) << ","
              << Sized(*collision->Geom()) << ",\"friction\":" << Number(friction) << "}";
  }
  out.links << "]}";
}

const char *Kind(sdf::JointType type)
{
  switch (type)
  {
    case sdf::JointType::FIXED: return "fixed";
    case sdf::JointType::REVOLUTE: return "revolute";
    case sdf::JointType::CONTINUOUS: return "continuous";
    case sdf::JointType::PRISMATIC: return "prismatic";
    default: return "other";
  }
}

template <class P>
void PrintJoint(const sdf::Joint &joint, const P &model, const std::string &prefix, Printed &out)
{
  P at;
  std::string parent, child;
  out.Check(joint.SemanticPose().Resolve(at, OWN));
  out.Check(joint.ResolveParentLink(parent));
  out.Check(joint.ResolveChildLink(child));
  at = model * at;
  const auto full = [&](const std::string &end) { return end == "world" ? end : prefix + end; };
  out.joints << (out.joints.tellp() > 0 ? "," : "") << Quoted(prefix + joint.Name())
             << ":{\"type\":" << Quoted(Kind(joint.Type())) << ",\"pose\":" << Placed(at)
             << ",\"parent\":" << Quoted(full(parent)) << ",\"child\":" << Quoted(full(child));
  if (const auto *axis = joint.Axis())
  {
    auto direction = axis->Xyz();
    out.Check(axis->ResolveXyz(direction, OWN));
    direction = model.Rot() * direction;
    out.joints << ",\"axis\":" << Three(direction) << ",\"lower\":" << Number(axis->Lower())
               << ",\"upper\":" << Number(axis->Upper()) << ",\"effort\":"
               << Number(axis->Effort()) << ",\"velocity\":" << Number(axis->MaxVelocity())
               << ",\"damping\":" << Number(axis->Damping()) << ",\"friction\":"
               << Number(axis->Friction());
  }
  out.joints << "}";
}

template <class P>
void PrintModel(const sdf::Model &model, const P &at, const std::string &prefix, Printed &out)
{
  for (uint64_t idx = 0; idx < model.LinkCount(); ++idx)
    PrintLink(*model.LinkByIndex(idx), at, prefix, out);
  for (uint64_t idx = 0; idx < model.JointCount(); ++idx)
    PrintJoint(*model.JointByIndex(idx), at, prefix, out);
  for (uint64_t idx = 0; idx < model.ModelCount(); ++idx)
  {
    const auto &nested = *model.ModelByIndex(idx);
    P own;
    out.Check(nested.SemanticPose().Resolve(own, OWN));
    PrintModel(nested, at * own, prefix + nested.Name() + "::", out);
  }
}

// Reads a file of a later version as one of the last that this library knows: what is new in them
// is left out with a warning.
std::string Text(const std::string &path)
{
  std::ifstream file(path);
  std::stringstream all;
  all << file.rdbuf();
  std::string text = all.str();
  for (const char *later : {"1.10", "1.11", "1.12"})
    for (const char mark : {'"', '\''})
    {
      const std::string written = "<sdf version=" + (mark + std::string(later)) + mark;
      const auto at = text.find(written);
      if (at != std::string::npos)
        text.replace(at, written.size(), "<sdf version=\"1.9\"");
    }
  return text;
}

void Print(const std::string &path)
{
  sdf::Root root;
  Printed out;
  out.Check(root.LoadSdfString(Text(path)));
  if (const auto *model = root.Model())
  {
    std::decay_t<decltype(model->RawPose())> origin;
    PrintModel(*model, origin, "", out);
  }
  else if (const auto *world = root.WorldByIndex(0))
  {
    for (uint64_t idx = 0; idx < world->ModelCount(); ++idx)
    {
      const auto &nested = *world->ModelByIndex(idx);
      std::decay_t<decltype(nested.RawPose())> own;
      out.Check(nested.SemanticPose().Resolve(own));
      PrintModel(nested, own, nested.Name() + "::", out);
    }
  }
  std::cout << "{\"file\":" << Quoted(path) << ",\"world\":" << (root.Model() ? "false" : "true") << ",\"faults\":"
            << Quoted(out.faults.str()) << ",\"links\":{" << out.links.str() << "},\"joints\":{"
            << out.joints.str() << "}}" << std::endl;
}
}  // namespace

int main(int count, char **words)
{
  if (count < 3)
    return 2;
  const std::filesystem::path folder = words[1];
  sdf::setFindCallback([folder](const std::string &uri)
  {
    const auto at = uri.find("://");
    return (folder / (at == std::string::npos ? uri : uri.substr(at + 3))).string();
  });
  for (int idx = 2; idx < count; ++idx)
    Print(words[idx]);
  return 0;
}
